//! Colours of particles as fluids.

use glam::Vec3;
use limpid::scene::MAX_FLUIDS;

/// The fluids of particles with these colours: the index of each particle's, and the fluids' colours. More colours
/// than fluids are joined into boxes of similar ones, which are cut at the median of their longest side (Heckbert,
/// "Color image quantization for frame buffer display", 1982).
pub(crate) fn fluids(colors: &[Vec3]) -> (Vec<u8>, Vec<Vec3>) {
    let bits = |color: &Vec3| color.to_array().map(f32::to_bits);
    let mut order: Vec<u32> = (0..colors.len() as u32).collect();
    let at = |&i: &u32| colors[i as usize];
    let mut boxes: Vec<&mut [u32]> = vec![&mut order];
    let extent = |members: &[u32]| {
        let ends = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        let (low, high) = members
            .iter()
            .map(at)
            .fold(ends, |(low, high), color| (low.min(color), high.max(color)));
        if members.is_empty() { Vec3::ZERO } else { high - low }
    };
    while boxes.len() < MAX_FLUIDS {
        let sizes = boxes.iter().map(|members| extent(members).max_element());
        let Some((widest, size)) = sizes.enumerate().max_by(|(_, a), (_, b)| a.total_cmp(b)) else {
            break;
        };
        if size <= 0.0 {
            break;
        }
        let members = boxes.swap_remove(widest);
        let axis = extent(members).max_position();
        members.sort_unstable_by(|a, b| at(a)[axis].total_cmp(&at(b)[axis]));
        // Equal colours stay together.
        let middle = at(&members[members.len() / 2])[axis];
        let mut cut = members.partition_point(|i| at(i)[axis] < middle);
        if cut == 0 {
            cut = members.partition_point(|i| at(i)[axis] <= middle);
        }
        let (low, high) = members.split_at_mut(cut);
        boxes.extend([low, high]);
    }
    boxes.retain(|members| !members.is_empty());
    // An order that does not depend on the cuts.
    boxes.sort_by_key(|members| members.iter().map(|i| bits(&at(i))).min());
    let mut indices = vec![0; colors.len()];
    let mut found = Vec::new();
    for (index, members) in boxes.iter().enumerate() {
        let sum: glam::DVec3 = members.iter().map(|i| at(i).as_dvec3()).sum();
        let alike = members.iter().all(|i| at(i) == at(&members[0]));
        let mean = (sum / members.len() as f64).as_vec3();
        found.push(if alike { at(&members[0]) } else { mean });
        members.iter().for_each(|&i| indices[i as usize] = index as u8);
    }
    (indices, found)
}
