//! Specialisations of refraction.

use crate::passes::mixture::Shares;
use crate::scene::Scene;
use crate::settings::{self, Fresnel, Reflections, Solids, Solver};

/// One specialisation of the shader.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Variant {
    /// The intersector.
    pub solver: Solver,
    /// `newton` reads mip levels.
    pub filter: bool,
    /// Pixels between samples of `march`.
    pub stride: u32,
    /// Iterations of `newton` and `secant`.
    pub iterations: u32,
    /// Rays per pixel.
    pub samples: u32,
    /// Only pixels whose picture has structure get as many, all others one.
    pub adaptive: bool,
    /// Rays per background pixel that contains an edge.
    pub edge_samples: u32,
    /// The frame has splashes.
    pub splash: bool,
    /// The intersector reads the bounds of the layers.
    pub bounds: bool,
    /// The liquid absorbs.
    pub absorption: bool,
    /// The fluids differ in absorption.
    pub mixture: bool,
    /// The liquid scatters light.
    pub turbid: bool,
    /// The fluids differ in scattering.
    pub scattering_mixture: bool,
    /// The reflectance formula.
    pub fresnel: Fresnel,
    /// Scale radiance by the square of the index.
    pub radiance_scaling: bool,
    /// The liquid can wet a solid.
    pub contact: bool,
    /// How rays outside the liquid find the solids.
    pub solids: Solids,
    /// Scene that reflected rays see.
    pub reflections: Reflections,
    /// A host has drawn the opaque scene.
    pub host: bool,
    /// Some of the fluids are opaque.
    pub opaque_fluids: bool,
    /// The scene has a background picture.
    pub background: bool,
    /// The environment covers no pixel.
    pub transparent: bool,
    /// Gaps between liquid and liquid that a pixel distinguishes.
    pub gaps: u32,
    /// No light enters the liquid: its first interface is all that is drawn.
    pub opaque: bool,
    /// The frame has foam, spray, bubbles or dust.
    pub diffuse: bool,
    /// Write the diagnostics.
    pub count: bool,
}

impl Variant {
    /// The variant with the fewest features that draws a frame.
    pub fn new(scene: &Scene, splash: bool, gaps: u32, host: bool, count: bool) -> Self {
        let settings = &match scene.is_opaque() {
            true => Self::read_by_opaque(&scene.settings.refract),
            false => scene.settings.refract.clone(),
        };
        let clear = !scene.is_opaque();
        let iterates = matches!(settings.solver, Solver::Newton | Solver::Secant);
        Self {
            solver: settings.solver,
            // Settings that an intersector does not read must not create variants of it.
            filter: settings.filter && settings.solver == Solver::Newton,
            stride: if settings.solver == Solver::March { settings.stride } else { 1 },
            iterations: if iterates { settings.iterations } else { 0 },
            samples: settings.samples,
            adaptive: settings.samples > 1 && settings.structure > 0.0,
            edge_samples: settings.edge_samples,
            splash,
            bounds: settings.solver == Solver::Guarded,
            absorption: clear && Shares::of_absorption(scene).strongest() > 0.0,
            mixture: clear && Shares::of_absorption(scene).are_mixed(),
            turbid: scene.is_turbid(),
            scattering_mixture: clear && Shares::of_scattering(scene).are_mixed(),
            fresnel: settings.fresnel,
            radiance_scaling: settings.radiance_scaling,
            contact: clear && settings.contact > 0.0 && (host || !scene.solids.is_empty()),
            solids: if host || scene.solids.is_empty() { Solids::Exact } else { settings.solids },
            reflections: settings.reflections,
            host,
            opaque_fluids: false,
            background: scene.background.is_some() && !host,
            transparent: settings.transparent,
            gaps,
            opaque: scene.is_opaque(),
            diffuse: false,
            count,
        }
    }

    /// The variant of a frame some of whose fluids are opaque.
    pub fn with_opaque_fluids(self) -> Self {
        Self { opaque_fluids: true, solids: Solids::Exact, ..self }
    }

    /// The settings that pictures of opaque bodies depend on; the others have their defaults.
    fn read_by_opaque(settings: &settings::Refract) -> settings::Refract {
        settings::Refract {
            samples: settings.samples,
            structure: settings.structure,
            edge_samples: settings.edge_samples,
            filter_patterns: settings.filter_patterns,
            transparent: settings.transparent,
            solver: Solver::Single,
            ..settings::Refract::default()
        }
    }

    pub fn shader(self) -> &'static str {
        if self.opaque {
            return "shade/opaque.wgsl";
        }
        match self.solver {
            Solver::Guarded => "refract/guarded.wgsl",
            Solver::March => "refract/march.wgsl",
            Solver::Newton => "refract/newton.wgsl",
            Solver::Secant => "refract/secant.wgsl",
            Solver::Plane => "refract/plane.wgsl",
            Solver::Plane3 => "refract/plane3.wgsl",
            Solver::Single => "refract/single.wgsl",
        }
    }

    /// The variant of the first rays of all pixels.
    pub(super) fn first(self) -> Self {
        match self.adaptive {
            true => Self {
                samples: 1,
                adaptive: false,
                edge_samples: self.edge_samples.max(self.samples),
                ..self
            },
            false => self,
        }
    }

    /// Whether its intersector reads mip levels of the layers.
    pub fn mips(self) -> bool {
        self.filter || self.solver == Solver::Plane3
    }

    pub fn constants(self) -> Vec<(&'static str, f64)> {
        let mut constants = self.switches().to_vec();
        if !self.opaque {
            constants.extend(self.inner_switches());
            constants.push(("ITERATIONS", self.iterations.into()));
        }
        constants.push(("SAMPLES", self.samples.into()));
        constants.push(("EDGE_SAMPLES", self.edge_samples.into()));
        constants.push(("GAPS", self.gaps.into()));
        match self.solver {
            Solver::Newton => constants.push(("FILTER", f64::from(u8::from(self.filter)))),
            Solver::Guarded => constants.push(("BOUNDS", f64::from(u8::from(self.bounds)))),
            Solver::March => constants.push(("STRIDE", self.stride.into())),
            _ => {}
        }
        constants
    }

    /// Switches of `refract/looks.wgsl` and `refract/pixels.wgsl`.
    fn switches(self) -> [(&'static str, f64); 8] {
        [
            ("SPLASH", self.splash),
            ("SCREEN_SOLIDS", self.solids == Solids::Screen),
            ("HOST", self.host),
            ("OPAQUE_FLUIDS", self.opaque_fluids),
            ("BACKGROUND", self.background),
            ("TRANSPARENT", self.transparent),
            ("DIFFUSE", self.diffuse),
            ("COUNT", self.count),
        ]
        .map(switch)
    }

    /// Switches of `refract/interfaces.wgsl`.
    fn inner_switches(self) -> [(&'static str, f64); 8] {
        [
            ("ABSORPTION", self.absorption),
            ("MIXTURE", self.mixture),
            ("TURBID", self.turbid),
            ("SCATTERING_MIXTURE", self.scattering_mixture),
            ("SCHLICK", self.fresnel == Fresnel::Schlick),
            ("RADIANCE_SCALING", self.radiance_scaling),
            ("CONTACT", self.contact),
            ("REFLECT_SOLIDS", self.reflections == Reflections::Scene),
        ]
        .map(switch)
    }
}

fn switch((name, on): (&'static str, bool)) -> (&'static str, f64) {
    (name, f64::from(u8::from(on)))
}
