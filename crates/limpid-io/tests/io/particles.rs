//! Readers and writers of particle files. Each format and variant yields the particles encoded in it;
//! errors of damaged and foreign files name the file, the location and the remedy; and no file makes a
//! reader panic, or allocate memory by its declared counts alone.

mod all_formats;
mod arrays;
mod bgeo;
mod csv;
mod damaged;
mod dualsphysics;
mod foam;
mod hdf5;
mod houdini;
mod npy;
mod npz;
mod other_programs;
mod places;
mod ply;
mod pos;
mod selection;
mod shapes;
mod shown;
mod simulators;
mod trajectories;
mod usable;
mod vtk;
mod vtu;
mod writing;
mod xyz;

use std::path::Path;

use glam::Vec3;
use limpid::liquid::Particles;
use limpid_io::Result;
use limpid_io::particles::{Contents, ReadOptions, Remark};

const POSITIONS: [[f32; 3]; 3] = [[0.5, -1.25, 2.0], [3.5, 4.0, -5.75], [0.0, 1e-3, 1e6]];
const VELOCITIES: [[f32; 3]; 3] = [[1.0, 0.0, -9.5], [0.25, 0.5, 0.75], [-0.0, 2.0, 3.0]];
const DENSITIES: [f32; 3] = [1000.0, 998.5, 1001.25];
const RADII: [f32; 3] = [0.025, 0.0, 0.5];
const IDS: [i32; 3] = [7, -1, 123_456_789];

fn positions_only() -> Particles {
    Particles::from_positions(POSITIONS.map(Vec3::from).to_vec())
}

fn all_attributes() -> Particles {
    Particles {
        velocities: Some(VELOCITIES.map(Vec3::from).to_vec()),
        densities: Some(DENSITIES.to_vec()),
        radii: Some(RADII.to_vec()),
        ids: Some(IDS.map(i64::from).to_vec()),
        ..positions_only()
    }
}

/// Names of the attributes that particles have.
fn all_names(particles: &Particles) -> Vec<&'static str> {
    limpid_io::particles::attribute_names(particles).collect()
}

fn read(name: &str, bytes: &[u8]) -> Result<Particles> {
    limpid_io::particles::parse(Path::new(name), bytes)
}

/// The message of the error that reading must return, which must name the file.
fn message(name: &str, bytes: &[u8]) -> String {
    let text = match read(name, bytes) {
        Ok(particles) => panic!("{name}: an error expected, got {particles:?}"),
        Err(error) => error.to_string(),
    };
    assert!(text.contains(name), "{text}");
    text
}

fn check_message(name: &str, bytes: &[u8], fragments: &[&str]) {
    let text = message(name, bytes);
    for fragment in fragments {
        assert!(text.contains(fragment), "{fragment:?} not in: {text}");
    }
}

/// Checks that particle `first` of three has no place in a file, and is left out with a remark.
fn check_left_out(name: &str, bytes: &[u8], first: usize) {
    let contents = Contents::parse(Path::new(name), bytes, &ReadOptions::default()).unwrap();
    let kept = (0..3).filter(|&i| i != first).map(|i| POSITIONS[i].into());
    assert_eq!(contents.particles.positions, kept.collect::<Vec<Vec3>>(), "{name}");
    let expected = [Remark::Unplaced { unplaced: 1, particles: 3, first }];
    assert_eq!(contents.remarks, expected, "{name}");
}

/// Bytes with the first occurrence of `from`, which must exist, replaced.
fn patched(bytes: &[u8], from: &[u8], to: &[u8]) -> Vec<u8> {
    let at = bytes.windows(from.len()).position(|window| window == from).expect("nothing to patch");
    [&bytes[..at], to, &bytes[at + from.len()..]].concat()
}

fn be<const N: usize>(numbers: [f32; N]) -> Vec<u8> {
    numbers.iter().flat_map(|number| number.to_be_bytes()).collect()
}

fn le<const N: usize>(numbers: [f32; N]) -> Vec<u8> {
    numbers.iter().flat_map(|number| number.to_le_bytes()).collect()
}

trait Reversed {
    fn map_reverse(self) -> Self;
}

impl Reversed for [u8; 4] {
    fn map_reverse(mut self) -> Self {
        self.reverse();
        self
    }
}
