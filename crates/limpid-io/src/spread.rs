//! The spread of the values of an attribute.

use serde::{Deserialize, Serialize};

/// The extremes of some values, and the range in which pictures of them differ most.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Spread {
    /// The smallest and the largest finite value.
    pub extremes: [f32; 2],
    /// The 2nd and the 98th percentile.
    pub usual: [f32; 2],
}

impl Spread {
    /// The spread of some values; those that are not finite do not count. `None` without others.
    pub fn of(mut values: Vec<f32>) -> Option<Self> {
        values.retain(|value| value.is_finite());
        let last = values.len().checked_sub(1)?;
        let mut at = |share: f64| {
            let place = (share * last as f64).round() as usize;
            *values.select_nth_unstable_by(place, f32::total_cmp).1
        };
        Some(Self { extremes: [at(0.0), at(1.0)], usual: [at(0.02), at(0.98)] })
    }

    /// The spread of these values and others, whose percentiles are not known and stand at the extremes.
    #[must_use]
    pub fn joined(self, other: Self) -> Self {
        let ([a, b], [c, d]) = (self.extremes, other.extremes);
        let extremes = [a.min(c), b.max(d)];
        Self { extremes, usual: extremes }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Outliers stretch the extremes alone, and NaN stretches neither.
    #[test]
    fn usual_ranges_leave_outliers_out() {
        let mut values: Vec<f32> = (0..=1000u16).map(f32::from).collect();
        values.extend([1e30, f32::NAN, -1e30, f32::INFINITY]);
        let Spread { extremes, usual: [low, high] } = Spread::of(values).unwrap();
        assert!((15.0..25.0).contains(&low) && (975.0..985.0).contains(&high), "{low} to {high}");
        assert_eq!(extremes, [-1e30, 1e30]);
        assert_eq!(Spread::of(vec![f32::NAN]), None);
        assert_eq!(Spread::of(vec![7.0]).unwrap().usual, [7.0, 7.0]);
    }
}
