//! Liquid from parameters alone: what stands in a scene's `[recipe]` instead of `[particles]`.
//!
//! A recipe says what body of liquid there is; [`Recipe::particles`] fills that body as SPH would,
//! and [`Recipe::body`] is the truth that the picture is measured against. Both depend on the
//! parameters alone: the same file gives the same particles, to the bit, on any number of threads.

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

/// A body of liquid; in the file, `kind` says which.
///
/// `count` is how many particles it is made of: 10 to 10,000,000, met to within 5 %. Their radius
/// follows from it, [`Recipe::particle_radius`]. `seed` chooses among arrangements, default 0.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase", deny_unknown_fields)]
pub enum Recipe {
    /// A ball.
    Ball {
        /// Its centre, m.
        center: DVec3,
        /// Its radius, m.
        radius: f64,
        /// Number of particles.
        count: f64,
        /// Chooses the arrangement.
        #[serde(default)]
        seed: u32,
    },
    /// An axis-aligned box.
    Slab {
        /// The corner with the smallest coordinates, m.
        min: DVec3,
        /// The corner with the largest.
        max: DVec3,
        /// Number of particles.
        count: f64,
        /// Chooses the arrangement.
        #[serde(default)]
        seed: u32,
    },
    /// A seated figure with many concavities.
    Idol(Idol),
    /// A breaking wave in a tank.
    Breaker(Breaker),
    /// Water that runs down a staircase.
    Cascade(Cascade),
    /// Calm water with waves in a rectangular basin.
    Pool(Pool),
    /// What a round vase holds.
    Vase(Vase),
}

/// The least share of the box around a body that the body may fill.
const LEAST_FILLED: f64 = 0.01;

/// Places that are looked at for each particle, at most, and always: a body that fills a hundredth of
/// the box around it takes a hundred, a sheet thinner than particles are far apart any number.
const MOST_PLACES: f64 = 400.0;
const ALWAYS_PLACES: f64 = 1e6;

/// Sines that are taken to place particles under waves, at most: some minutes.
const MOST_WORK: f64 = 1e11;

/// A droplet: where it is, its radius in particle spacings (0 for a lone particle).
struct Droplet {
    center: DVec3,
    size: f64,
}

impl Droplet {
    /// No droplet is larger, in particle spacings.
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
        let place = match *self {
            Self::Ball { center, .. } => [("center", center); 2],
            Self::Slab { min, max, .. } => [("min", min), ("max", max)],
            Self::Idol(Idol { base, .. }) | Self::Vase(Vase { base, .. }) => [("base", base); 2],
            Self::Breaker(_) | Self::Cascade(_) | Self::Pool(_) => [("", DVec3::ZERO); 2],
        };
        for (key, point) in place {
            // Beyond this 32-bit particles are further apart than their radius.
            if !point.is_finite() || point.abs().max_element() > 1e4 {
                return fail(format!("{key} is {point}, expected coordinates up to 10000 m"));
            }
        }
        if let Self::Slab { min, max, .. } = self {
            /// So thin that volumes and distances keep their digits.
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

    /// The number of particles asked for.
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

    /// The share of the particles that are thrown clear of the body.
    fn spray(&self) -> f64 {
        match *self {
            Self::Breaker(Breaker { spray, .. }) | Self::Cascade(Cascade { spray, .. }) => spray,
            _ => 0.0,
        }
    }

    /// How many waves its surface is the sum of.
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

    /// Where the liquid is, droplets apart.
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

    /// Solids that come with the liquid.
    pub fn solids(&self) -> Vec<Solid> {
        match self {
            Self::Pool(pool) => pool.solids(),
            _ => Vec::new(),
        }
    }

    /// Radius r of the particles, m: each has the volume of a cube of side 2 r.
    pub fn particle_radius(&self) -> f64 {
        0.5 * self.spacing(self.body().volume())
    }

    fn spacing(&self, volume: f64) -> f64 {
        (volume / (self.count() * (1.0 - self.spray()))).cbrt()
    }

    /// The particles.
    ///
    /// They are spread evenly but not regularly, and lie at least about r inside the body's
    /// surface, the outermost layer at just that depth, as SPH boundaries leave liquid. The surface
    /// drawn from them with default settings lies within half a radius of the body's.
    ///
    /// # Errors
    /// As [`Recipe::check`]; [`Error::Invalid`] for proportions that leave so little liquid in the
    /// box around it that looking for it would take forever; [`Error::Memory`].
    pub fn particles(&self) -> Result<Particles> {
        self.check()?;
        let fail = |problem: String| Err(Error::invalid("recipe", problem));
        let body = self.body();
        let volume = body.volume();
        if volume < LEAST_FILLED * (body.max - body.min).element_product() {
            return fail("the liquid is too thin for the space that it extends over".into());
        }
        let count = self.count();
        let spacing = self.spacing(volume);
        let places = fill::places(&body, spacing);
        if places.is_nan() || places > MOST_PLACES * count + ALWAYS_PLACES {
            return fail(format!(
                "count is {count}: particles would be {spacing:.3e} m apart, too far for liquid this \
                 thin; make count larger or the liquid thicker"
            ));
        }
        let work = places * f64::from(self.waves());
        if work > MOST_WORK {
            let waves = self.waves();
            return fail(format!(
                "waves.count is {waves}, too many for a count of {count}: {work:.0e} sines would be \
                 taken, at most {MOST_WORK:.0e}"
            ));
        }
        memory::probe((count as usize).saturating_mul(fill::BYTES), "a recipe's particles")?;
        let mut points = fill::fill(&body, spacing, self.seed());
        let thrown = (self.spray() * self.count()) as usize;
        match self {
            Self::Breaker(breaker) => {
                fill::scatter(&mut points, &body, spacing, thrown, breaker.droplets());
            }
            Self::Cascade(cascade) => {
                fill::scatter(&mut points, &body, spacing, thrown, cascade.droplets());
            }
            _ => {}
        }
        let positions = points.iter().map(|x| x.as_vec3()).collect();
        Ok(Particles::from_positions(positions))
    }
}
