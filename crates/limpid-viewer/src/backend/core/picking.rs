//! The particle that is seen at a place of the picture, and its values.

use glam::{DVec2, DVec3, UVec2};
use serde::{Deserialize, Serialize};

use limpid::camera::Camera;
use limpid::liquid::Particles;
use limpid_io::color_by::ColorBy;
use limpid_io::error::Result;
use limpid_io::input::{FrameTime, Loader};
use limpid_io::notice::brief;

/// A line of sight.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Sight {
    /// Where it begins, m.
    pub from: DVec3,
    /// Its direction, of length 1.
    pub direction: DVec3,
}

/// A particle.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Picked {
    /// The frame time.
    pub at: FrameTime,
    /// Its centre in the world, m.
    pub place: DVec3,
    /// Its radius, m.
    pub radius: f64,
    /// Names and values of its attributes.
    pub values: Vec<(String, String)>,
}

impl Sight {
    /// That through a place in a picture of `size` pixels, from the upper left corner, both coordinates 0 to 1.
    pub fn through(camera: &Camera, size: UVec2, place: DVec2) -> Self {
        let view = camera.uniform(size, camera.eye);
        let row =
            |i: usize| DVec3::from_array(view.view_from_world.map(|column| f64::from(column[i])));
        let [right, up, back] = [row(0), row(1), row(2)];
        let offset = DVec2::new(2.0 * place.x - 1.0, 1.0 - 2.0 * place.y);
        let offset = offset * view.tangent.as_dvec2() + view.shift.as_dvec2();
        let aside = offset.x * right + offset.y * up;
        // In a parallel view the place moves the line, not its direction.
        match view.far > 0.0 {
            true => Self { from: camera.eye + aside, direction: -back },
            false => Self { from: camera.eye, direction: (aside - back).normalize_or(-back) },
        }
    }

    /// The nearest of some balls that it meets, by its number.
    pub fn first(&self, balls: impl Iterator<Item = (DVec3, f64)>) -> Option<usize> {
        let met = balls.enumerate().filter_map(|(i, (place, radius))| {
            let to = place - self.from;
            let along = to.dot(self.direction);
            let aside = (to - along * self.direction).length_squared();
            (along > 0.0 && aside <= radius * radius)
                .then(|| (i, along - (radius * radius - aside).sqrt()))
        });
        met.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(i, _)| i)
    }
}

/// Reads a frame again, and finds the first particle of it in a line of sight.
///
/// # Errors
/// As [`Loader::contents`].
pub fn pick(
    input: &Loader,
    by: Option<ColorBy>,
    at: FrameTime,
    sight: &Sight,
) -> Result<Option<Picked>> {
    let input = input.clone().colored_by(by);
    let particles = input.contents(at)?.particles;
    let radius = input.radius(at, &particles)?;
    let radius_of = |i: usize| {
        particles.radii.as_ref().and_then(|radii| radii.get(i)).copied().unwrap_or(radius)
    };
    let balls = (0..particles.len()).map(|i| (particles.place(i), f64::from(radius_of(i))));
    Ok(sight.first(balls).map(|i| Picked {
        at,
        place: particles.place(i),
        radius: radius_of(i).into(),
        values: values(&particles, i, radius_of(i), &input),
    }))
}

/// Names and values of a particle's attributes, its place in the axes of the files.
fn values(particles: &Particles, i: usize, radius: f32, input: &Loader) -> Vec<(String, String)> {
    let mut all = Vec::new();
    let mut tell = |name: &str, value: Option<String>| {
        all.extend(value.map(|value| (name.to_owned(), value)));
    };
    let up = input.up().0;
    let vector = |x: DVec3| {
        let numbers = up.from_y_up(x).to_array().map(|x| brief(x as f32).to_string());
        numbers.join(", ")
    };
    tell("number", Some(i.to_string()));
    tell("id", particles.ids.as_ref().map(|ids| ids[i].to_string()));
    tell("fluid", particles.fluids.as_ref().map(|fluids| (fluids[i] + 1).to_string()));
    tell("position", Some(format!("{} m", vector(particles.place(i)))));
    tell("radius", Some(format!("{} m", brief(radius))));
    let velocity = particles.velocities.as_ref().map(|velocities| velocities[i]);
    tell("velocity", velocity.map(|v| format!("{} m/s", vector(v.as_dvec3()))));
    tell("speed", velocity.map(|v| format!("{} m/s", brief(v.length()))));
    let density = particles.densities.as_ref().map(|densities| densities[i]);
    tell("density", density.map(|density| format!("{} kg/m³", brief(density))));
    if let Some(by) = input.color_by() {
        let value = particles.values.as_ref().and_then(|values| values.get(i)).copied();
        tell(by.attribute.name(), value.map(|value| brief(value).to_string()));
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use limpid::camera::Lens;

    /// The middle of the picture is the target, and its upper edge half the field of view above; parallel lines are moved
    /// aside. The nearest ball that is met is found, not one behind the eye.
    #[test]
    fn lines_of_sight_are_those_of_the_camera() {
        let camera = Camera {
            eye: DVec3::new(0.0, 0.0, 4.0),
            target: DVec3::ZERO,
            fov_y: 90.0,
            ..Camera::fit(-DVec3::ONE, DVec3::ONE)
        };
        let size = UVec2::new(200, 100);
        let middle = Sight::through(&camera, size, DVec2::splat(0.5));
        assert!(middle.direction.distance(-DVec3::Z) < 1e-6);
        let corner = Sight::through(&camera, size, DVec2::new(1.0, 0.0)).direction;
        assert!(corner.distance(DVec3::new(2.0, 1.0, -1.0).normalize()) < 1e-6, "{corner}");
        let parallel = Camera { lens: Some(Lens::Orthographic { height: 2.0 }), ..camera };
        let corner = Sight::through(&parallel, size, DVec2::new(1.0, 0.0));
        assert!(corner.from.distance(DVec3::new(2.0, 1.0, 4.0)) < 1e-6, "{corner:?}");
        assert!(corner.direction.distance(-DVec3::Z) < 1e-6);
        let balls = [-1.0, 9.0, 2.0, 1.0].map(|z| (DVec3::new(0.0, 0.05, z), 0.1));
        assert_eq!(middle.first(balls.into_iter()), Some(2));
        assert_eq!(middle.first([(DVec3::Y, 0.5)].into_iter()), None);
    }
}
