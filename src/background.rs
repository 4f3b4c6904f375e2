//! The background picture: behind everything that the camera sees.

use std::sync::Arc;

use glam::{DVec2, UVec2};
use rayon::prelude::*;

use crate::error::Result;
use crate::gpu::Gpu;
use crate::memory;
use crate::mesh::{Texture, linear_from_srgb};

/// A scene's background on the device, of the size of the picture.
#[derive(Debug, Default)]
pub(crate) struct Background {
    /// The texture that it was made from, its size and its view.
    uploaded: Option<(Arc<Texture>, UVec2, wgpu::TextureView)>,
}

impl Background {
    /// Uploads a background unless it is there.
    ///
    /// # Errors
    /// [`crate::Error::Memory`] if it does not fit.
    pub(crate) fn prepare(
        &mut self,
        gpu: &Gpu,
        texture: Option<&Arc<Texture>>,
        size: UVec2,
    ) -> Result<()> {
        let Some(texture) = texture else {
            self.uploaded = None;
            return Ok(());
        };
        let same = |(old, old_size, _): &(Arc<Texture>, UVec2, _)| {
            Arc::ptr_eq(old, texture) && *old_size == size
        };
        if self.uploaded.as_ref().is_some_and(same) {
            return Ok(());
        }
        memory::probe(size.x as usize * size.y as usize * size_of::<[f32; 4]>(), "the background")?;
        let usage = wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST;
        let format = wgpu::TextureFormat::Rgba32Float;
        let image = gpu.texture("background", size, 1, format, usage);
        let pixels = fitted(texture, size);
        gpu.queue.write_texture(
            image.as_image_copy(),
            bytemuck::cast_slice(&pixels),
            wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(16 * size.x),
                rows_per_image: None,
            },
            image.size(),
        );
        let view = image.create_view(&Default::default());
        self.uploaded = Some((texture.clone(), size, view));
        Ok(())
    }

    /// The background, if the scene has one.
    pub(crate) fn view(&self) -> Option<&wgpu::TextureView> {
        self.uploaded.as_ref().map(|(_, _, view)| view)
    }
}

/// Linear RGB of a background in a picture of `size`, row by row from the top: it fills the picture and keeps
/// its shape; excess width or height is cut off at both sides. Each pixel is a mean over its area.
#[doc(hidden)]
pub fn fitted(texture: &Texture, size: UVec2) -> Vec<[f32; 4]> {
    let linear: Vec<f32> = (0..=255u8).map(|c| linear_from_srgb(f32::from(c) / 255.0)).collect();
    let (own, wanted) = (texture.size().as_dvec2(), size.as_dvec2());
    // Texels per pixel.
    let scale = (own / wanted).min_element();
    let corner = 0.5 * (own - scale * wanted);
    let taps = (scale.ceil() as u32).clamp(1, 64);
    let last = texture.size() - 1;
    let at = |u: DVec2| {
        let texel = u.max(DVec2::ZERO).as_uvec2().min(last);
        texture.pixels()[texel.y as usize * texture.size().x as usize + texel.x as usize]
    };
    let pixel = |index: u32| {
        let place = DVec2::new(f64::from(index % size.x), f64::from(index / size.x));
        let mut sum = [0.0; 3];
        for k in 0..taps * taps {
            let tap = DVec2::new(f64::from(k % taps), f64::from(k / taps)) + 0.5;
            let color = at(corner + scale * (place + tap / f64::from(taps)));
            for (sum, c) in sum.iter_mut().zip(color) {
                *sum += linear[usize::from(c)];
            }
        }
        let [r, g, b] = sum.map(|c| c / (taps * taps) as f32);
        [r, g, b, 1.0]
    };
    (0..size.x * size.y).into_par_iter().map(pixel).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Guards against backgrounds that are stretched or shifted: a picture twice as wide as it is high fills a
    /// square with its middle, and shrinks to the mean of its texels.
    #[test]
    fn backgrounds_fill_the_picture_and_keep_their_shape() {
        let gray = |c: u8| [c, c, c, 255];
        let columns = [10, 20, 30, 40].map(gray);
        let texture = Texture::new(UVec2::new(4, 2), [columns, columns].concat()).unwrap();
        let value = |c: u8| linear_from_srgb(f32::from(c) / 255.0);
        let [left, right] = fitted(&texture, UVec2::new(2, 2))[..2] else { panic!("four pixels") };
        assert_eq!([left[0], right[0]], [value(20), value(30)]);
        let [middle] = fitted(&texture, UVec2::ONE)[..] else { panic!("one pixel") };
        assert!((middle[0] - 0.5 * (value(20) + value(30))).abs() < 1e-7);
    }
}
