//! Numbers in text: how files write them, and messages.

/// Formats a number with thousands separators: `40,368`.
pub fn thousands(number: usize) -> String {
    let digits = number.to_string();
    let comma = |at: usize| at > 0 && (digits.len() - at).is_multiple_of(3);
    let digit = |(at, digit)| if comma(at) { vec![',', digit] } else { vec![digit] };
    digits.chars().enumerate().flat_map(digit).collect()
}

/// A number with the digits that a message needs: four.
pub fn brief(number: f32) -> f32 {
    format!("{number:.3e}").parse().unwrap_or(number)
}

/// Parses a number. NaN is written in many ways: pandas leaves the field empty, and Microsoft's library writes
/// `1.#QNAN`, `-1.#IND`, `-nan(ind)`.
pub(crate) fn float(field: &[u8]) -> Option<f64> {
    let text = std::str::from_utf8(field).ok()?;
    let not_a_number = || {
        let empty = text.is_empty();
        let text = text.trim_start_matches(['+', '-']).to_ascii_lowercase();
        empty || text.starts_with("1.#") || text.starts_with("nan(") || text == "none"
    };
    text.parse().ok().or_else(|| not_a_number().then_some(f64::NAN))
}
