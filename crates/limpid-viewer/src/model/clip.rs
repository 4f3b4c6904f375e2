//! A plane that cuts the liquid: only the particles on one side of it are read.

use limpid_io::particles::Selection;

/// A plane perpendicular to an axis of the files.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Clip {
    /// The axis: 0 for x.
    pub axis: usize,
    /// Whether the particles above it are shown, not those below.
    pub above: bool,
    /// Its place, in the unit of the files.
    pub at: f64,
}

/// Names of the axes.
pub const AXES: [&str; 3] = ["x", "y", "z"];

impl Clip {
    /// The plane that a selection is, if it is one.
    pub fn of(select: &Selection) -> Option<Self> {
        let Selection::Where(_) = select else { return None };
        let text = select.to_string();
        let axis = AXES.iter().position(|axis| text.starts_with(axis))?;
        let (above, number) = match (text[1..].strip_prefix("<="), text[1..].strip_prefix(">=")) {
            (Some(number), _) => (false, number),
            (_, Some(number)) => (true, number),
            _ => return None,
        };
        Some(Self { axis, above, at: number.parse().ok()? })
    }

    /// The selection of the particles on its side.
    pub fn selection(&self) -> Selection {
        let sign = if self.above { ">=" } else { "<=" };
        let text = format!("{}{sign}{}", AXES[self.axis], self.at);
        text.parse().unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A plane is a selection and back; other selections are no plane.
    #[test]
    fn planes_are_selections() {
        for (axis, above, at) in [(0, true, 0.25), (1, false, -3.0), (2, true, 1e-3)] {
            let clip = Clip { axis, above, at };
            assert_eq!(Clip::of(&clip.selection()), Some(clip));
        }
        for other in ["all", "type==1", "x<=1 and y>=2", "xyz<=1"] {
            let select: Selection = other.parse().expect("a selection");
            assert_eq!(Clip::of(&select), None, "{other}");
        }
    }
}
