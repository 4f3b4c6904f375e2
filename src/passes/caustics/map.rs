//! The finished map of a light.

use glam::UVec2;

use crate::error::Result;
use crate::gpu::Gpu;
use crate::light_view::LightView;

/// The caustic map of a light.
#[derive(Debug, Clone)]
pub struct CausticMap {
    /// The light's view.
    pub view: LightView,
    /// Irradiance on the receivers through the liquid (W/m², red, green, blue), and whether the direct
    /// light bypasses the liquid (1 or 0): in layer [`CausticMap::layer`], at its corner, at the view's
    /// size.
    pub map: wgpu::Texture,
    /// Planes of the receivers in the light's view, and the disparity of the liquid's front.
    pub receivers: wgpu::Texture,
    /// Layer of both textures.
    pub layer: u32,
}

impl CausticMap {
    /// Reads the map back, row by row from the top left: irradiance (W/m²) and whether the direct light
    /// bypasses the liquid; depth of the receiver, m, 0 where there is none.
    ///
    /// # Errors
    /// [`crate::Error::DeviceLost`].
    #[cfg(not(target_arch = "wasm32"))]
    pub fn read(&self, gpu: &Gpu) -> Result<(Vec<[f32; 4]>, Vec<f32>)> {
        pollster::block_on(self.finish(gpu))
    }

    /// As `CausticMap::read`, for code that browsers and other programs share: waiting yields in a browser and
    /// blocks elsewhere.
    ///
    /// # Errors
    /// [`crate::Error::DeviceLost`].
    pub async fn finish(&self, gpu: &Gpu) -> Result<(Vec<[f32; 4]>, Vec<f32>)> {
        let size = self.view.size;
        let texels = async |texture: &wgpu::Texture| -> Result<Vec<[f32; 4]>> {
            let bytes = gpu.begin_reading(texture, self.layer).finish(gpu).await?;
            let all: Vec<[f32; 4]> = bytemuck::pod_collect_to_vec(&bytes);
            let rows = all.chunks_exact(texture.width() as usize).take(size.y as usize);
            Ok(rows.flat_map(|row| &row[..size.x as usize]).copied().collect())
        };
        let depths = texels(&self.receivers).await?.into_iter().zip(0..).map(|(plane, i)| {
            let center = UVec2::new(i % size.x, i / size.x).as_dvec2() + 0.5;
            let ndc = (2.0 * center / size.as_dvec2() - 1.0) * self.view.half_extent;
            let [x, y, z, _] = plane.map(f64::from);
            let disparity = x * ndc.x - y * ndc.y - z;
            let depth =
                if self.view.orthographic { self.view.far - disparity } else { 1.0 / disparity };
            if disparity > 0.0 { depth as f32 } else { 0.0 }
        });
        Ok((texels(&self.map).await?, depths.collect()))
    }
}
