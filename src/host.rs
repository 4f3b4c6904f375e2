//! The opaque scene of a host: a program that draws its own world and has limpid draw the liquid in it.
//!
//! Rays find the host's scene where its picture shows it, as light does in Imai, Kanamori and Mitani (2016),
//! who know the opaque scene by a G-buffer. Elsewhere they fall back to the solids of the [`Scene`], which may
//! be coarse, and then to its environment.
//!
//! [`Scene`]: crate::scene::Scene

use glam::{DMat4, DVec4, UVec2};

use crate::camera::{View, parallel_near};
use crate::error::{Error, Result};

/// The images that a host has drawn before the liquid: [`FrameInput::host`]. All views are two-dimensional, of the
/// picture's size, with one sample per pixel and `TEXTURE_BINDING` usage. They are read when the recorded
/// commands run.
///
/// [`FrameInput::host`]: crate::frame::FrameInput::host
#[derive(Debug, Clone)]
pub struct Host {
    /// Linear radiance: a float format, or an sRGB format, which the device decodes.
    pub color: wgpu::TextureView,
    /// Depth: a depth format without stencil, or a float format that holds the same. 32-bit floats of reversed
    /// depth are the most accurate; 16 bits are too few.
    pub depth: wgpu::TextureView,
    /// Normals in world space, of any length, in a float or signed normalised format. Without them, or where
    /// they are 0, limpid derives them from depths, which is exact on planes.
    pub normals: Option<wgpu::TextureView>,
    /// The projection that the depths were drawn with, as for [`View::from_matrices`]: of reversed or forward
    /// depth, with a far plane or without. Depths are 0 (reversed) or 1 where nothing was drawn.
    ///
    /// [`View::from_matrices`]: crate::camera::View::from_matrices
    pub clip_from_view: DMat4,
}

/// Share of rays whose end the host's picture does not show.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct HostRays {
    /// Rays that were looked up: all ends of the paths through the liquid.
    pub rays: u32,
    /// Those of them that met a solid of the scene or its environment.
    pub fallbacks: u32,
}

impl HostRays {
    /// The share that fell back, 0 to 1; 0 without rays.
    pub fn share(self) -> f64 {
        f64::from(self.fallbacks) / f64::from(self.rays.max(1))
    }
}

/// How a projection encodes depth.
#[derive(Debug, Clone, Copy)]
pub(crate) struct DepthCode {
    perspective: bool,
    scale: f64,
    shift: f64,
}

impl DepthCode {
    /// The code of a matrix as for [`View::from_matrices`].
    ///
    /// [`View::from_matrices`]: crate::camera::View::from_matrices
    fn of(clip_from_view: DMat4) -> Self {
        let c = clip_from_view.to_cols_array_2d();
        let (perspective, scale, shift) = (c[2][3] != 0.0, c[2][2], c[3][2]);
        // [`View::from_matrices`] moves the eye of parallel rays back that begin behind it.
        let behind = if perspective { 0.0 } else { (-parallel_near(scale, shift)).max(0.0) };
        Self { perspective, scale, shift: shift + behind * scale }
    }

    /// Depth where nothing was drawn: 0 if depths fall with distance, else 1.
    pub(crate) fn cleared(self) -> f64 {
        let reversed = if self.perspective { self.shift > 0.0 } else { self.scale > 0.0 };
        if reversed { 0.0 } else { 1.0 }
    }

    /// Offset and slope of disparity, (depth + offset) × slope; in an orthographic view of the height above
    /// a plane at the depth `far`, m.
    pub(crate) fn disparity(self, far: f64) -> (f64, f64) {
        match self.perspective {
            true => (self.scale, self.shift.recip()),
            false => (far * self.scale - self.shift, self.scale.recip()),
        }
    }

    /// Depth of the far plane of an orthographic view, m; 0 in perspective.
    pub(crate) fn far(self) -> f64 {
        if self.perspective { 0.0 } else { (self.shift - self.cleared()) / self.scale }
    }

    /// Whether depths differ at all.
    fn is_usable(self) -> bool {
        let slope = if self.perspective { self.shift } else { self.scale };
        slope != 0.0 && self.scale.is_finite() && self.shift.is_finite()
    }
}

impl Host {
    /// How its depths are encoded.
    pub(crate) fn depth_code(&self) -> DepthCode {
        DepthCode::of(self.clip_from_view)
    }

    /// Fails if it does not fit a picture of `size` pixels, whose particles have `radius`, m.
    pub(crate) fn check(&self, view: &View, radius: f32, size: UVec2) -> Result<()> {
        /// Largest distance of an orthographic far plane, particle radii: 32-bit heights above it then have
        /// the digits that Newton's method needs.
        const FARTHEST: f64 = 1e5;
        let views = [("color", Some(&self.color)), ("depth", Some(&self.depth))];
        for (name, view) in views.into_iter().chain([("normals", self.normals.as_ref())]) {
            let Some(texture) = view.map(wgpu::TextureView::texture) else { continue };
            let extent = UVec2::new(texture.width(), texture.height());
            let part = || format!("host {name}");
            if extent != size {
                let problem = format!("its size is {extent}, that of the picture {size}");
                return Err(Error::invalid(part(), problem));
            }
            if texture.sample_count() != 1 {
                return Err(Error::invalid(part(), "it has several samples per pixel; resolve it"));
            }
            if !texture.usage().contains(wgpu::TextureUsages::TEXTURE_BINDING) {
                return Err(Error::invalid(part(), "it was created without TEXTURE_BINDING usage"));
            }
        }
        let fail = |problem: String| Err(Error::invalid("host", problem));
        let bottom = self.clip_from_view.row(3);
        let code = self.depth_code();
        if ![DVec4::W, DVec4::NEG_Z].contains(&bottom) {
            return fail(
                "its projection must be perspective or orthographic, looking down -z".into(),
            );
        }
        if !code.is_usable() {
            return fail("its projection gives all points the same depth".into());
        }
        if code.perspective == view.is_orthographic() {
            return fail("one of its projection and the view is orthographic".into());
        }
        let farthest = FARTHEST * f64::from(radius);
        if radius > 0.0 && code.far() > farthest {
            let problem = format!(
                "its far plane is {:.3} m away; with parallel rays it must be within 100,000 particle \
                 radii, {farthest:.3} m",
                code.far()
            );
            return fail(problem);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::dcamera::rh::proj::directx::{
        orthographic, perspective, perspective_infinite, perspective_infinite_reverse,
    };

    /// Guards against a wrong reading of the depth buffer: each kind of projection gives a point's
    /// disparity, and its cleared depth the farthest.
    #[test]
    fn disparity_is_that_of_each_projection() {
        let infinite_reversed = perspective_infinite_reverse(1.0, 1.0, 0.1);
        let forward = perspective(1.0, 1.0, 0.1, 50.0);
        let infinite = perspective_infinite(1.0, 1.0, 0.1);
        let reversed = perspective(1.0, 1.0, 50.0, 0.1);
        for (clip_from_view, cleared) in
            [(infinite_reversed, 0.0), (forward, 1.0), (infinite, 1.0), (reversed, 0.0)]
        {
            let code = DepthCode::of(clip_from_view);
            let clip = clip_from_view * DVec4::new(0.3, 0.2, -4.0, 1.0);
            let (offset, slope) = code.disparity(0.0);
            assert!(((clip.z / clip.w + offset) * slope - 0.25).abs() < 1e-12);
            assert_eq!(code.cleared(), cleared);
        }
        for (near, far, cleared) in [(0.5, 20.0, 1.0), (20.0, 0.5, 0.0)] {
            let parallel = orthographic(-1.0, 1.0, -1.0, 1.0, near, far);
            let code = DepthCode::of(parallel);
            let clip = parallel * DVec4::new(0.3, 0.2, -4.0, 1.0);
            let (offset, slope) = code.disparity(25.0);
            assert!(((clip.z + offset) * slope - 21.0).abs() < 1e-12);
            assert_eq!(code.cleared(), cleared);
            assert!((code.far() - 20.0).abs() < 1e-12);
        }
        // The eye moves back by 3 m to the near plane.
        for (near, far) in [(-3.0, 20.0), (20.0, -3.0)] {
            let parallel = orthographic(-1.0, 1.0, -1.0, 1.0, near, far);
            let code = DepthCode::of(parallel);
            let clip = parallel * DVec4::new(0.3, 0.2, -4.0, 1.0);
            let (offset, slope) = code.disparity(25.0);
            assert!(((clip.z + offset) * slope - 18.0).abs() < 1e-12);
            assert!((code.far() - 23.0).abs() < 1e-12);
        }
    }
}
