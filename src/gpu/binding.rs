//! Types of bindings, of which [`Gpu::layout`] makes layouts.

use super::Gpu;

impl Gpu {
    /// As [`uniform`], for values that decide branches; see [`Gpu::uniforms_are_stored`].
    pub fn branching<T>(&self) -> wgpu::BindingType {
        if self.uniforms_are_stored() { storage_of(size_of::<T>() as u64) } else { uniform::<T>() }
    }

    /// `$layers`: layers that a shader reads at one mip level; see [`Gpu::layers_are_stored`].
    pub fn layers(&self) -> wgpu::BindingType {
        let view_dimension = wgpu::TextureViewDimension::D2Array;
        if !self.layers_are_stored() {
            return sampled(view_dimension);
        }
        let access = wgpu::StorageTextureAccess::ReadOnly;
        wgpu::BindingType::StorageTexture { access, format: super::LAYER_FORMAT, view_dimension }
    }
}

/// `var<uniform> x: T`; pipeline creation checks the size.
pub fn uniform<T>() -> wgpu::BindingType {
    buffer::<T>(wgpu::BufferBindingType::Uniform)
}

/// `var<storage, read> x: array<T>`.
pub fn storage<T>() -> wgpu::BindingType {
    buffer::<T>(wgpu::BufferBindingType::Storage { read_only: true })
}

/// `var<storage, read> x: S` of at least `bytes`, for structs that end in an array.
pub fn storage_of(bytes: u64) -> wgpu::BindingType {
    buffer_of(wgpu::BufferBindingType::Storage { read_only: true }, bytes)
}

/// `var<storage, read_write> x: S` of at least `bytes`.
pub fn storage_read_write(bytes: u64) -> wgpu::BindingType {
    buffer_of(wgpu::BufferBindingType::Storage { read_only: false }, bytes)
}

fn buffer<T>(ty: wgpu::BufferBindingType) -> wgpu::BindingType {
    buffer_of(ty, size_of::<T>() as u64)
}

fn buffer_of(ty: wgpu::BufferBindingType, bytes: u64) -> wgpu::BindingType {
    wgpu::BindingType::Buffer {
        ty,
        has_dynamic_offset: false,
        min_binding_size: wgpu::BufferSize::new(bytes),
    }
}

/// `texture_2d<f32>` or, with `D2Array`, `texture_2d_array<f32>`, read with `textureLoad`.
pub fn sampled(view_dimension: wgpu::TextureViewDimension) -> wgpu::BindingType {
    wgpu::BindingType::Texture {
        sample_type: wgpu::TextureSampleType::Float { filterable: false },
        view_dimension,
        multisampled: false,
    }
}

/// `texture_2d<u32>`, read with `textureLoad`.
pub fn sampled_integers() -> wgpu::BindingType {
    wgpu::BindingType::Texture {
        sample_type: wgpu::TextureSampleType::Uint,
        view_dimension: wgpu::TextureViewDimension::D2,
        multisampled: false,
    }
}

/// `texture_storage_2d[_array]<format, write>`.
pub fn storage_texture(
    format: wgpu::TextureFormat,
    view_dimension: wgpu::TextureViewDimension,
) -> wgpu::BindingType {
    wgpu::BindingType::StorageTexture {
        access: wgpu::StorageTextureAccess::WriteOnly,
        format,
        view_dimension,
    }
}

/// `texture_storage_2d_array<r32uint, read_write>`.
pub fn state_texture() -> wgpu::BindingType {
    wgpu::BindingType::StorageTexture {
        access: wgpu::StorageTextureAccess::ReadWrite,
        format: wgpu::TextureFormat::R32Uint,
        view_dimension: wgpu::TextureViewDimension::D2Array,
    }
}
