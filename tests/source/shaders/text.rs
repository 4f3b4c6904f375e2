//! Shaders as texts: their loops, and shifts that browsers refuse.

/// File, function and header of a loop.
pub(crate) type Loop = (String, String, String);

/// Lists the loops of a shader. Fails for a loop whose header is not a counted loop with a condition.
pub(crate) fn loops(file: &str, text: &str) -> Result<Vec<Loop>, String> {
    let mut function = "";
    let mut found = Vec::new();
    for line in text.lines() {
        let code = line.split("//").next().unwrap_or_default().trim();
        let words: Vec<_> = code.split(|c: char| !c.is_alphanumeric() && c != '_').collect();
        if let Some(at) = words.iter().position(|&word| word == "fn") {
            function = words.get(at + 1).copied().unwrap_or_default();
        }
        if !["for", "while", "loop"].iter().any(|keyword| words.contains(keyword)) {
            continue;
        }
        let header = code.trim_end_matches('{').trim();
        let parts: Vec<_> = header.split(';').map(str::trim).collect();
        let counted = header.starts_with("for (var ")
            && parts.len() == 3
            && ["<", "<=", ">"].iter().any(|compare| parts[1].contains(&format!(" {compare} ")))
            && parts[2] != ")";
        if !counted {
            return Err(format!("{file}, {function}: {header} has no bound"));
        }
        found.push((file.to_owned(), function.to_owned(), header.to_owned()));
    }
    Ok(found)
}

/// Whether a line has a shift beside a bitwise operation without parentheses between them, which browsers refuse.
pub(crate) fn mixes_shifts(line: &str) -> bool {
    let code = line.split("//").next().unwrap_or_default();
    let code = code.replace("&&", " ").replace("||", " ");
    // For each open parenthesis, whether there was a shift and a bitwise operation.
    let mut levels = vec![(false, false)];
    let mut last = ' ';
    for c in code.chars() {
        let top = levels.len() - 1;
        match c {
            '(' | '[' => levels.push((false, false)),
            ')' | ']' if top > 0 => drop(levels.pop()),
            ',' | ';' | '=' => levels[top] = (false, false),
            '<' | '>' if last == c => levels[top].0 = true,
            '|' | '&' | '^' => levels[top].1 = true,
            _ => {}
        }
        if levels.contains(&(true, true)) {
            return true;
        }
        last = c;
    }
    false
}
