//! File names with a placeholder for the frame number: `{}`, `####`, `%04d`, `$F4`.

/// Offset and length of the first placeholder, and its minimum number of digits.
pub(crate) fn placeholder(name: &str) -> Option<(usize, usize, usize)> {
    name.char_indices().find_map(|(at, _)| {
        let rest = &name[at..];
        let digits = |text: &str| text.bytes().take_while(u8::is_ascii_digit).count();
        if rest.starts_with("{}") {
            Some((at, 2, 1))
        } else if rest.starts_with('#') {
            let width = rest.bytes().take_while(|&byte| byte == b'#').count();
            Some((at, width, width))
        } else if let Some(rest) = rest.strip_prefix("$F") {
            let (length, width) = width(rest, digits(rest))?;
            Some((at, 2 + length, width))
        } else {
            let rest = rest.strip_prefix('%')?;
            let (length, width) = width(rest, digits(rest))?;
            rest[length..].starts_with('d').then_some((at, length + 2, width))
        }
    })
}

/// Length and value of the `digits` leading digits of `text`; the value is 1 without any. No name is longer than 255.
fn width(text: &str, digits: usize) -> Option<(usize, usize)> {
    let value = if digits == 0 { 1 } else { text[..digits].parse::<u8>().ok()?.into() };
    Some((digits, value))
}
