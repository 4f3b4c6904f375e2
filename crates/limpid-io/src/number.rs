//! Numbers in messages.

/// Formats a number with thousands separators: `40,368`.
pub fn thousands(number: usize) -> String {
    let digits = number.to_string();
    let comma = |at: usize| at > 0 && (digits.len() - at).is_multiple_of(3);
    let digit = |(at, digit)| if comma(at) { vec![',', digit] } else { vec![digit] };
    digits.chars().enumerate().flat_map(digit).collect()
}
