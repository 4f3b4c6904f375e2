//! Shader modules, layouts and pipelines: each is made once for a device, whichever passes, views and renderers use it.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};

use rayon::prelude::*;

use super::Gpu;
use super::prune::prune;
use super::shader::{self, Library, Words};

/// The modules, layouts and pipelines of a device. An entry is empty while it is made.
#[derive(Debug, Default)]
pub(super) struct Compiled {
    /// By text, which does not depend on all constants.
    modules: Mutex<HashMap<String, Entry<wgpu::ShaderModule>>>,
    /// By stages and bindings.
    layouts: Mutex<HashMap<(wgpu::ShaderStages, Vec<wgpu::BindingType>), wgpu::BindGroupLayout>>,
    pipelines: Mutex<HashMap<Kernel, Entry<wgpu::ComputePipeline>>>,
}

type Entry<T> = Arc<OnceLock<T>>;

/// An entry point of a shader with these words, its layouts, and its constants with the bits of their values.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(crate) struct Kernel {
    shader: String,
    words: Words,
    entry_point: String,
    layouts: Vec<wgpu::BindGroupLayout>,
    constants: Vec<(String, u64)>,
}

impl Kernel {
    /// An entry point of a root with these words, specialised by `constants`.
    pub(crate) fn new(
        shader: &str,
        words: Words,
        entry_point: &str,
        layouts: &[&wgpu::BindGroupLayout],
        constants: &[(&str, f64)],
    ) -> Self {
        let bits = |&(name, value): &(&str, f64)| (name.to_owned(), value.to_bits());
        Self {
            shader: shader.to_owned(),
            words,
            entry_point: entry_point.to_owned(),
            layouts: layouts.iter().copied().cloned().collect(),
            constants: constants.iter().map(bits).collect(),
        }
    }
}

/// A panic while something was made leaves the map as it was.
fn locked<T>(map: &Mutex<T>) -> MutexGuard<'_, T> {
    map.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Gpu {
    /// The shader module of a root of a library, with these words and for pipelines with these constants.
    pub(crate) fn module(
        &self,
        library: Library,
        root: &str,
        words: Words,
        constants: &[(&str, f64)],
    ) -> wgpu::ShaderModule {
        let words = Words {
            stored_uniforms: self.uniforms_are_stored(),
            stored_layers: self.layers_are_stored() && !words.mips,
            grain: self.grain(),
            ..words
        };
        let create = |text: &str| {
            self.device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some(root),
                source: wgpu::ShaderSource::Wgsl(text.into()),
            })
        };
        let text = prune(&library.source(root, words), constants);
        let entry = locked(&self.compiled.modules).entry(text.clone()).or_default().clone();
        entry.get_or_init(|| create(&text)).clone()
    }

    /// The layout of bindings 0, 1, … visible to `stages`.
    pub fn layout(
        &self,
        label: &str,
        stages: wgpu::ShaderStages,
        bindings: &[wgpu::BindingType],
    ) -> wgpu::BindGroupLayout {
        let create = || {
            let entries: Vec<_> = (0u32..)
                .zip(bindings)
                .map(|(binding, &ty)| wgpu::BindGroupLayoutEntry {
                    binding,
                    visibility: stages,
                    ty,
                    count: None,
                })
                .collect();
            self.device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
                label: Some(label),
                entries: &entries,
            })
        };
        let key = (stages, bindings.to_vec());
        locked(&self.compiled.layouts).entry(key).or_insert_with(create).clone()
    }
}

/// A bind group, and its layout for the pipelines that read it.
#[doc(hidden)]
#[derive(Debug, Clone)]
pub struct Bound {
    pub layout: wgpu::BindGroupLayout,
    pub group: wgpu::BindGroup,
}

impl Gpu {
    /// Binds resources of these types to bindings 0, 1, … of compute shaders.
    #[doc(hidden)]
    pub fn bind(
        &self,
        label: &str,
        bindings: &[(wgpu::BindingType, wgpu::BindingResource<'_>)],
    ) -> Bound {
        let types: Vec<_> = bindings.iter().map(|(ty, _)| *ty).collect();
        let resources: Vec<_> = bindings.iter().map(|(_, resource)| resource.clone()).collect();
        let layout = self.layout(label, wgpu::ShaderStages::COMPUTE, &types);
        let group = self.bind_group(label, &layout, &resources);
        Bound { layout, group }
    }

    /// Creates a bind group with `resources` at bindings 0, 1, ….
    #[doc(hidden)]
    pub fn bind_group(
        &self,
        label: &str,
        layout: &wgpu::BindGroupLayout,
        resources: &[wgpu::BindingResource<'_>],
    ) -> wgpu::BindGroup {
        let entries: Vec<_> = (0u32..)
            .zip(resources)
            .map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource: resource.clone() })
            .collect();
        self.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(label),
            layout,
            entries: &entries,
        })
    }

    /// The compute pipeline of an entry point of a shader file, specialised by `constants`.
    #[doc(hidden)]
    pub fn compute_pipeline(
        &self,
        shader: &str,
        entry_point: &str,
        layouts: &[&wgpu::BindGroupLayout],
        constants: &[(&str, f64)],
    ) -> wgpu::ComputePipeline {
        self.pipeline_of(
            shader::RENDERER,
            shader,
            Words::default(),
            entry_point,
            layouts,
            constants,
        )
    }

    /// As [`Gpu::compute_pipeline`], of a library and with these words.
    #[doc(hidden)]
    pub fn pipeline_of(
        &self,
        library: Library,
        shader: &str,
        words: Words,
        entry_point: &str,
        layouts: &[&wgpu::BindGroupLayout],
        constants: &[(&str, f64)],
    ) -> wgpu::ComputePipeline {
        let kernel = Kernel::new(shader, words, entry_point, layouts, constants);
        self.known(&kernel).unwrap_or_else(|| self.compile(library, &kernel))
    }

    /// The pipelines of entry points, in their order. New ones are compiled side by side.
    pub(crate) fn pipelines<const N: usize>(
        &self,
        kernels: [Kernel; N],
    ) -> [wgpu::ComputePipeline; N] {
        // A frame finds them all, and would only wait for threads to wake.
        let known = kernels.each_ref().map(|kernel| self.known(kernel));
        if known.iter().all(Option::is_some) {
            return known.map(|pipeline| pipeline.expect("all are known"));
        }
        let make = |(kernel, known): (Kernel, Option<_>)| {
            known.unwrap_or_else(|| self.compile(shader::RENDERER, &kernel))
        };
        let made: Vec<_> = kernels.into_par_iter().zip(known).map(make).collect();
        made.try_into().expect("one for each kernel")
    }

    fn known(&self, kernel: &Kernel) -> Option<wgpu::ComputePipeline> {
        locked(&self.compiled.pipelines).get(kernel)?.get().cloned()
    }

    /// Compiles a pipeline. Threads that need the same one wait for it; others compile theirs meanwhile.
    fn compile(&self, library: Library, kernel: &Kernel) -> wgpu::ComputePipeline {
        let entry = locked(&self.compiled.pipelines).entry(kernel.clone()).or_default().clone();
        entry.get_or_init(|| self.new_pipeline(library, kernel)).clone()
    }

    fn new_pipeline(&self, library: Library, kernel: &Kernel) -> wgpu::ComputePipeline {
        let layouts: Vec<_> = kernel.layouts.iter().map(Some).collect();
        let layout = self.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some(&kernel.shader),
            bind_group_layouts: &layouts,
            immediate_size: 0,
        });
        let value = |(name, bits): &(String, u64)| (name.clone(), f64::from_bits(*bits));
        let constants: Vec<_> = kernel.constants.iter().map(value).collect();
        let constants: Vec<_> = constants.iter().map(|(name, value)| (&name[..], *value)).collect();
        self.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(&format!("{} {}", kernel.shader, kernel.entry_point)),
            layout: Some(&layout),
            module: &self.module(library, &kernel.shader, kernel.words, &constants),
            entry_point: Some(&kernel.entry_point),
            compilation_options: wgpu::PipelineCompilationOptions {
                constants: &constants,
                // No shader reads uninitialised workgroup memory.
                zero_initialize_workgroup_memory: false,
            },
            cache: self.cache(),
        })
    }
}
