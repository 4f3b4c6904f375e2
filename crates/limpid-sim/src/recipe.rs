//! Recipes: bodies of liquid defined by parameters, in a scene's `[recipe]` instead of `[particles]`.
//!
//! [`Recipe::body`] is the exact shape, the ground truth that pictures are measured against, and
//! [`Recipe::particles`] fills it with particles distributed as in SPH. Both depend on the parameters
//! alone: the same file gives bit-identical particles on any number of threads.

mod body;
mod breaker;
mod cascade;
mod fill;
mod idol;
mod pool;
mod vase;

use glam::DVec3;
use serde::{Deserialize, Serialize};

pub use body::Body;
pub use breaker::Breaker;
pub use cascade::Cascade;
pub use idol::Idol;
pub use pool::{Pool, Reef};
pub use vase::Vase;

use limpid::error::{Error, Result, printable};
use limpid::liquid::Particles;
use limpid::memory;
use limpid::scene::Solid;

/// A parametric body of liquid, of the kind named by `kind` in the file.
///
/// `count` is the number of particles: 10 to 10,000,000, met to within 5 %. It determines their radius,
/// [`Recipe::particle_radius`]. `seed` selects the arrangement, default 0.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase", deny_unknown_fields)]
pub enum Recipe {
    /// A ball.
    Ball {
        /// The centre, m.
        center: DVec3,
        /// The radius, m.
        radius: f64,
        /// Number of particles.
        count: f64,
        /// Seed of the arrangement.
        #[serde(default)]
        seed: u32,
    },
    /// An axis-aligned box.
    Slab {
        /// The corner with the smallest coordinates, m.
        min: DVec3,
        /// The corner with the largest coordinates, m.
        max: DVec3,
        /// Number of particles.
        count: f64,
        /// Seed of the arrangement.
        #[serde(default)]
        seed: u32,
    },
    /// A seated figure with many concavities.
    Idol(Idol),
    /// A breaking wave in a tank.
    Breaker(Breaker),
    /// Water running down a staircase.
    Cascade(Cascade),
    /// Calm water with waves in a rectangular basin.
    Pool(Pool),
    /// The liquid in a round vase.
    Vase(Vase),
}

/// Smallest ratio of a body's volume to that of its bounding box.
const MIN_FILL: f64 = 0.01;

/// Largest number of candidate positions per particle. A body that fills a hundredth of its bounding box
/// takes a hundred; for a sheet thinner than the particle spacing there is no bound.
const MAX_CANDIDATES_PER_PARTICLE: f64 = 400.0;
/// Number of candidate positions allowed in addition, at any count.
const CANDIDATE_ALLOWANCE: f64 = 1e6;

/// Largest number of sines evaluated to place particles under waves: some minutes.
const MAX_SINES: f64 = 1e11;

/// A droplet.
struct Droplet {
    center: DVec3,
    /// Radius in particle spacings; 0 for a single particle.
    size: f64,
}

impl Droplet {
    /// Largest size, in particle spacings.
    const LARGEST: f64 = 2.0;
}

impl Recipe {
    /// Checks all values against their ranges.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming the first key that is out of its range.
    pub fn check(&self) -> Result<()> {
        let fail = |problem: String| {
            let problem = printable(problem);
            Err(Error::invalid("recipe", problem))
        };
        let points = match *self {
            Self::Ball { center, .. } => [("center", center); 2],
            Self::Slab { min, max, .. } => [("min", min), ("max", max)],
            Self::Idol(Idol { base, .. }) | Self::Vase(Vase { base, .. }) => [("base", base); 2],
            Self::Breaker(_) | Self::Cascade(_) | Self::Pool(_) => [("", DVec3::ZERO); 2],
        };
        for (key, point) in points {
            // Beyond this, 32-bit positions are too coarse.
            if !point.is_finite() || point.abs().max_element() > 1e4 {
                return fail(format!("{key} is {point}, expected coordinates up to 10000 m"));
            }
        }
        if let Self::Slab { min, max, .. } = self {
            /// Thickness, m, down to which volumes and distances keep their precision.
            const THINNEST: f64 = 1e-9;
            if !(*max - *min).cmpge(DVec3::splat(THINNEST)).all() {
                return fail(format!("min must be below max, by at least {THINNEST} m"));
            }
        }
        let size = 1e-3..=1e3;
        let ranges = match *self {
            Self::Ball { radius, .. } => vec![("radius", radius, size)],
            Self::Slab { .. } => Vec::new(),
            Self::Idol(Idol { height, .. }) => vec![("height", height, size)],
            Self::Breaker(breaker) => breaker.ranges(size),
            Self::Cascade(cascade) => cascade.ranges(size),
            Self::Pool(pool) => pool.ranges(size),
            Self::Vase(vase) => vase.ranges(size),
        };
        for (key, value, range) in ranges.into_iter().chain([("count", self.count(), 10.0..=1e7)]) {
            if !range.contains(&value) {
                let (low, high) = (range.start(), range.end());
                return fail(format!("{key} is {value}, expected {low} to {high}"));
            }
        }
        Ok(())
    }

    /// The requested number of particles.
    pub fn count(&self) -> f64 {
        match *self {
            Self::Ball { count, .. }
            | Self::Slab { count, .. }
            | Self::Idol(Idol { count, .. })
            | Self::Breaker(Breaker { count, .. })
            | Self::Cascade(Cascade { count, .. })
            | Self::Pool(Pool { count, .. })
            | Self::Vase(Vase { count, .. }) => count,
        }
    }

    /// Fraction of the particles in droplets clear of the body.
    fn spray(&self) -> f64 {
        match *self {
            Self::Breaker(Breaker { spray, .. }) | Self::Cascade(Cascade { spray, .. }) => spray,
            _ => 0.0,
        }
    }

    /// Number of sines of the surface.
    fn waves(&self) -> u32 {
        match self {
            Self::Pool(pool) => pool.waves.count,
            _ => 0,
        }
    }

    fn seed(&self) -> u64 {
        match *self {
            Self::Ball { seed, .. }
            | Self::Slab { seed, .. }
            | Self::Idol(Idol { seed, .. })
            | Self::Breaker(Breaker { seed, .. })
            | Self::Cascade(Cascade { seed, .. })
            | Self::Pool(Pool { seed, .. })
            | Self::Vase(Vase { seed, .. }) => seed.into(),
        }
    }

    /// The shape of the liquid, without droplets.
    pub fn body(&self) -> Body {
        match *self {
            Self::Ball { center, radius, .. } => body::ball(center, radius),
            Self::Slab { min, max, .. } => body::slab(min, max),
            Self::Idol(idol) => idol.body(),
            Self::Breaker(breaker) => breaker.body(),
            Self::Cascade(cascade) => cascade.body(),
            Self::Pool(pool) => pool.body(),
            Self::Vase(vase) => vase.body(),
        }
    }

    /// Solids of the recipe, in addition to those of the scene.
    pub fn solids(&self) -> Vec<Solid> {
        match self {
            Self::Pool(pool) => pool.solids(),
            _ => Vec::new(),
        }
    }

    /// Radius r of the particles, m. A particle has the volume of a cube of side 2 r.
    pub fn particle_radius(&self) -> f64 {
        0.5 * self.spacing(self.body().volume())
    }

    fn spacing(&self, volume: f64) -> f64 {
        (volume / (self.count() * (1.0 - self.spray()))).cbrt()
    }

    /// Generates the particles.
    ///
    /// They are evenly but not regularly distributed, at a depth of at least about r, the outermost
    /// layer at that depth, as SPH boundary handling leaves them. The surface drawn from them with
    /// default settings lies within half a radius of the body's.
    ///
    /// # Errors
    /// As [`Recipe::check`]; [`Error::Invalid`] for a body that fills so little of its bounding box that
    /// sampling would take too long; [`Error::Memory`].
    pub fn particles(&self) -> Result<Particles> {
        self.check()?;
        let fail = |problem: String| Err(Error::invalid("recipe", problem));
        let body = self.body();
        let volume = body.volume();
        if volume < MIN_FILL * (body.max - body.min).element_product() {
            return fail("the liquid is too thin for the space that it extends over".into());
        }
        let count = self.count();
        let spacing = self.spacing(volume);
        let candidates = fill::places(&body, spacing);
        if candidates.is_nan()
            || candidates > MAX_CANDIDATES_PER_PARTICLE * count + CANDIDATE_ALLOWANCE
        {
            return fail(format!(
                "count is {count}: particles would be {spacing:.3e} m apart, too far for liquid this \
                 thin; make count larger or the liquid thicker"
            ));
        }
        let sines = candidates * f64::from(self.waves());
        if sines > MAX_SINES {
            let waves = self.waves();
            return fail(format!(
                "waves.count is {waves}, too many for a count of {count}: {sines:.0e} sines would be \
                 taken, at most {MAX_SINES:.0e}"
            ));
        }
        memory::probe((count as usize).saturating_mul(fill::BYTES), "a recipe's particles")?;
        let mut points = fill::fill(&body, spacing, self.seed());
        let spray = (self.spray() * self.count()) as usize;
        match self {
            Self::Breaker(breaker) => {
                fill::scatter(&mut points, &body, spacing, spray, breaker.droplets());
            }
            Self::Cascade(cascade) => {
                fill::scatter(&mut points, &body, spacing, spray, cascade.droplets());
            }
            _ => {}
        }
        let positions = points.iter().map(|x| x.as_vec3()).collect();
        let is_hull = matches!(self, Self::Pool(_));
        Ok(Particles { is_hull, ..Particles::from_positions(positions) })
    }
}
