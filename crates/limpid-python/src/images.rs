//! Intermediate images: by the names that they have in Python, and as the channels of OpenEXR files.

use glam::UVec2;
use limpid::aov::{self, Aov, Channel, Part};
use numpy::ndarray::{ArrayView3, ArrayViewD, Axis};
use numpy::{
    IntoPyArray as _, PyArray3, PyArrayDyn, PyArrayMethods as _, PyUntypedArrayMethods as _,
};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::errors;

/// The kinds of the images with these names: kinds, `all`, or single images as `front.depth`.
pub(crate) fn chosen(names: &[String]) -> PyResult<Vec<Aov>> {
    let mut chosen = Vec::new();
    for name in names {
        let kind = match name.split_once('.') {
            Some((layer, kind)) if is_layer(layer, kind) => kind,
            Some(("caustics", _)) => "caustics",
            _ => name,
        };
        for aov in aov::parse_list(kind).map_err(|e| errors::raise(e.into()))? {
            if !chosen.contains(&aov) {
                chosen.push(aov);
            }
        }
    }
    Ok(chosen)
}

/// The layers of an image, by their names in EXR files and here.
const LAYERS: [(&str, &str); 4] = [
    ("aggregate_front", "front"),
    ("aggregate_back", "back"),
    ("splash_front", "splash_front"),
    ("splash_back", "splash_back"),
];

/// Whether there is an image of this kind of a layer.
fn is_layer(layer: &str, kind: &str) -> bool {
    let smooth = ["smooth_depth", "smooth_normal"].contains(&kind);
    match layer {
        "front" | "back" => smooth || ["depth", "normal"].contains(&kind),
        _ => ["depth", "normal"].contains(&kind) && LAYERS.iter().any(|(_, known)| *known == layer),
    }
}

/// Kind and name of the image that a channel belongs to, as `depth` and `front.depth`.
fn image_of(part: &str, channel: &str) -> (String, String) {
    let components: Vec<&str> = channel.split('.').collect();
    if let Some(light) = part.strip_prefix("caustics.") {
        return ("caustics".into(), format!("caustics.{light}.{}", components[0]));
    }
    let kind = components[0].to_owned();
    let layer = components.get(1).and_then(|name| LAYERS.iter().find(|(known, _)| known == name));
    let name = layer.map_or_else(|| kind.clone(), |(_, layer)| format!("{layer}.{kind}"));
    (kind, name)
}

/// Images by name: of shape (height, width), or (height, width, channels) for several channels.
pub(crate) fn images<'py>(
    py: Python<'py>,
    parts: Vec<Part>,
    wanted: &[String],
) -> PyResult<Bound<'py, PyDict>> {
    let found = PyDict::new(py);
    for Part { name: part, size, channels } in parts {
        let mut groups: Vec<(String, String, Vec<Channel>)> = Vec::new();
        for channel in channels {
            let (kind, name) = image_of(&part, &channel.name);
            match groups.iter_mut().find(|(_, known, _)| *known == name) {
                Some((_, _, channels)) => channels.push(channel),
                None => groups.push((kind, name, vec![channel])),
            }
        }
        for (kind, name, mut channels) in groups {
            if !wanted.iter().any(|wanted| *wanted == name || *wanted == kind || wanted == "all") {
                continue;
            }
            // Masks of fluids are a list, however many there are.
            if channels.len() == 1 && kind != "mask" {
                let shape = [size.y as usize, size.x as usize];
                let values = channels.remove(0).values;
                found.set_item(name, values.into_pyarray(py).reshape(shape)?)?;
            } else {
                found.set_item(name, interleaved(py, size, &channels)?)?;
            }
        }
    }
    Ok(found)
}

/// Channels as an array of shape (height, width, channels).
pub(crate) fn interleaved<'py>(
    py: Python<'py>,
    size: UVec2,
    channels: &[Channel],
) -> PyResult<Bound<'py, PyArray3<f32>>> {
    let (count, pixels) = (channels.len(), size.x as usize * size.y as usize);
    let mut values = Vec::with_capacity(count * pixels);
    for i in 0..pixels {
        values.extend(channels.iter().map(|channel| channel.values[i]));
    }
    values.into_pyarray(py).reshape([size.y as usize, size.x as usize, count])
}

/// A picture's linear radiance and its images, as parts of one OpenEXR file: the radiance and the images of its size,
/// and the maps of lights.
///
/// # Errors
/// `ValueError` for an image that is not an array as those of pictures.
pub(crate) fn parts(
    radiance: ArrayView3<'_, f32>,
    images: &Bound<'_, PyDict>,
) -> PyResult<Vec<Part>> {
    let names = ["R", "G", "B", "A"].map(String::from);
    let mut parts = vec![Part { name: String::new(), ..part(radiance.into_dyn(), &names) }];
    for (name, image) in images {
        let name: String = name.extract()?;
        let image = image
            .cast_into::<PyArrayDyn<f32>>()
            .ok()
            .filter(|image| (2..4).contains(&image.ndim()));
        let image = image.ok_or_else(|| {
            PyValueError::new_err(format!(
                "aov[{name:?}] was replaced; expected an array of float32"
            ))
        })?;
        let image = image.try_readonly()?;
        let image = image.as_array();
        let count = image.shape().get(2).copied().unwrap_or(1);
        let (of, channels) = channels(&name, count);
        let Part { size, channels, .. } = part(image, &channels);
        match parts.iter_mut().find(|part| part.name == of) {
            Some(part) if part.size == size => part.channels.extend(channels),
            _ => parts.push(Part { name: of, size, channels }),
        }
    }
    if parts.len() > 1 {
        // Files of several parts need names for all.
        parts[0].name = "limpid".into();
    }
    Ok(parts)
}

/// An image of shape (height, width) or (height, width, channels).
fn part(image: ArrayViewD<'_, f32>, names: &[String]) -> Part {
    let size = UVec2::new(image.shape()[1] as u32, image.shape()[0] as u32);
    let channel = |(i, name): (usize, &String)| Channel {
        name: name.clone(),
        values: match image.ndim() {
            2 => image.iter().copied().collect(),
            _ => image.index_axis(Axis(2), i).iter().copied().collect(),
        },
    };
    let count = image.shape().get(2).copied().unwrap_or(1);
    Part {
        name: String::new(),
        size,
        channels: names.iter().take(count).enumerate().map(channel).collect(),
    }
}

/// The part and the channels of an image with this name, whose channels are so many: the inverse of `image_of`.
fn channels(name: &str, count: usize) -> (String, Vec<String>) {
    if let Some((light, map)) = name.strip_prefix("caustics.").and_then(|rest| rest.split_once('.'))
    {
        let part = format!("caustics.{light}");
        let colors = ["R", "G", "B"].map(|color| format!("{map}.{color}"));
        return (part, if count == 1 { vec![map.to_owned()] } else { colors.to_vec() });
    }
    let (kind, base) = match name.split_once('.') {
        Some((layer, kind)) => {
            let layer =
                LAYERS.iter().find(|(_, known)| *known == layer).map_or(layer, |(layer, _)| layer);
            (kind, format!("{kind}.{layer}"))
        }
        None => (name, name.to_owned()),
    };
    let axes: Vec<String> = match kind {
        "depth" if base == "depth" => vec!["Z".into()],
        "coverage" => vec!["A".into()],
        "mask" => (1..=count).map(|fluid| format!("fluid{fluid}")).collect(),
        "radiance" => ["R", "G", "B"].map(String::from).to_vec(),
        _ if count > 1 => ["X", "Y", "Z"].map(String::from).to_vec(),
        _ => return (String::new(), vec![base]),
    };
    (String::new(), axes.iter().map(|axis| format!("{base}.{axis}")).collect())
}
