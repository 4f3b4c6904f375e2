//! Branches that a pipeline's constants rule out are removed from its shader's text.
//!
//! Drivers inline a function wherever it is called before they look at conditions, so they would compile everything that a
//! scene lacks. On Mesa's lavapipe that took two thirds of the time to make the pipelines of refraction.

use std::collections::HashMap;

/// Values of constants by their names; switches are 0 or 1.
type Values = HashMap<String, f64>;

/// The text of a shader without comments and without the branches that `constants`, and the default values of the others,
/// rule out. Conditions are decided by constants alone, with `!`, `&&`, `||`, comparisons and parentheses; others are kept.
/// Block comments, and names that hide a constant, are not understood.
pub fn prune(source: &str, constants: &[(&str, f64)]) -> String {
    let lines = source.lines().map(|line| line.split("//").next().unwrap_or_default().trim_end());
    let mut text = lines.collect::<Vec<_>>().join("\n");
    let mut values = declared(&text);
    values.extend(constants.iter().map(|&(name, value)| (name.to_owned(), value)));
    let mut at = 0;
    while let Some(start) = next_if(&text, at) {
        at = start + 2;
        let Some(body) = text[start..].find('{').map(|brace| start + brace) else { break };
        match decide(&text[at..body], &values) {
            // The next condition may begin at the same place.
            Some(true) => at = keep_body(&mut text, start, body),
            Some(false) => at = drop_body(&mut text, start, body),
            None => {}
        }
    }
    text
}

/// The constants that the text declares with a plain value.
fn declared(text: &str) -> Values {
    let constant = |line: &str| {
        let declaration = line.strip_prefix("override ").or_else(|| line.strip_prefix("const "))?;
        let (left, right) = declaration.split_once('=')?;
        let name = left.split(':').next()?.trim();
        Some((name.to_owned(), number(right.trim().trim_end_matches(';'))?))
    };
    text.lines().filter_map(constant).collect()
}

fn number(word: &str) -> Option<f64> {
    match word {
        "true" => Some(1.0),
        "false" => Some(0.0),
        _ if word.starts_with(|c: char| c == '-' || c.is_ascii_digit()) => {
            word.trim_end_matches(['u', 'i', 'f']).parse().ok()
        }
        _ => None,
    }
}

/// The place of the next `if` at or after `from`, but for that of `break if`.
fn next_if(text: &str, from: usize) -> Option<usize> {
    let is_word = |c: char| c == '_' || c.is_ascii_alphanumeric();
    let begins = |&(place, _): &(usize, &str)| {
        let before = &text[..place];
        let is_alone = !before.ends_with(is_word) && !text[place + 2..].starts_with(is_word);
        is_alone && !before.trim_end().ends_with("break")
    };
    let found = text[from..].match_indices("if").map(|(place, word)| (from + place, word));
    found.into_iter().find(begins).map(|(place, _)| place)
}

/// The value of a condition, if constants decide it.
fn decide(condition: &str, values: &Values) -> Option<bool> {
    let condition = condition.trim();
    for (operator, decisive) in [("||", true), ("&&", false)] {
        let parts = split(condition, operator);
        if parts.len() > 1 {
            let parts: Vec<_> = parts.into_iter().map(|part| decide(part, values)).collect();
            let decided = parts.contains(&Some(decisive));
            return match decided {
                true => Some(decisive),
                false => parts.iter().all(Option::is_some).then_some(!decisive),
            };
        }
    }
    if condition.starts_with('(') && end_of_group(condition, 0) == condition.len() {
        return decide(&condition[1..condition.len() - 1], values);
    }
    if let Some(rest) = condition.strip_prefix('!') {
        return decide(rest, values).map(|holds| !holds);
    }
    let value = |word: &str| number(word.trim()).or_else(|| values.get(word.trim()).copied());
    let operators = ["==", "!=", "<=", ">=", "<", ">"];
    let found = operators
        .into_iter()
        .find_map(|operator| Some((operator, condition.split_once(operator)?)));
    if let Some((operator, (left, right))) = found {
        let order = value(left)?.partial_cmp(&value(right)?)?;
        return Some(match operator {
            "==" => order.is_eq(),
            "!=" => order.is_ne(),
            "<=" => order.is_le(),
            ">=" => order.is_ge(),
            "<" => order.is_lt(),
            _ => order.is_gt(),
        });
    }
    value(condition).map(|value| value != 0.0)
}

/// The parts of a condition between operators that no parentheses enclose.
fn split<'a>(condition: &'a str, operator: &str) -> Vec<&'a str> {
    let mut parts = Vec::new();
    let mut begin = 0;
    let mut depth = 0;
    for (place, c) in condition.char_indices() {
        match c {
            '(' | '[' => depth += 1,
            ')' | ']' => depth -= 1,
            _ if depth == 0 && condition[place..].starts_with(operator) => {
                parts.push(&condition[begin..place]);
                begin = place + operator.len();
            }
            _ => {}
        }
    }
    parts.push(&condition[begin..]);
    parts
}

/// The end of the group that the bracket at `start` opens.
fn end_of_group(text: &str, start: usize) -> usize {
    let mut depth = 0;
    for (place, c) in text[start..].char_indices() {
        match c {
            '(' | '{' => depth += 1,
            ')' | '}' => depth -= 1,
            _ => {}
        }
        if depth == 0 {
            return start + place + 1;
        }
    }
    text.len()
}

/// The place of the branch after an `else`, if one follows at `at`.
fn other_branch(text: &str, at: usize) -> Option<usize> {
    let rest = text[at..].trim_start().strip_prefix("else")?;
    let branch = rest.trim_start();
    let is_word = branch.len() < rest.len() || branch.starts_with('{');
    is_word.then_some(text.len() - branch.len())
}

/// Replaces the condition at `start`, which holds, by its `body`, and returns the place of that.
fn keep_body(text: &mut String, start: usize, body: usize) -> usize {
    let first = end_of_group(text, body);
    // The other branches go.
    let mut end = first;
    while let Some(branch) = other_branch(text, end) {
        let brace = text[branch..].find('{').map_or(text.len(), |brace| branch + brace);
        end = end_of_group(text, brace);
    }
    text.replace_range(first..end, "");
    text.replace_range(start..body, "");
    start
}

/// Removes the condition at `start`, which does not hold, with its `body`, and returns the place of what follows.
fn drop_body(text: &mut String, start: usize, body: usize) -> usize {
    let end = end_of_group(text, body);
    if let Some(branch) = other_branch(text, end) {
        text.replace_range(start..branch, "");
        return start;
    }
    // With the `else` before it, if there is one.
    let before = text[..start].trim_end();
    let start = before.strip_suffix("else").map_or(start, |before| before.trim_end().len());
    text.replace_range(start..end, "");
    start
}

#[cfg(test)]
mod tests {
    use super::prune;

    const DECLARED: &str =
        "override HOST: bool = false;\noverride GAPS: u32 = 2u;\nconst SKY: u32 = 3u;\n";

    /// Prunes a body, and returns it in one line.
    fn pruned(body: &str, constants: &[(&str, f64)]) -> String {
        let text = prune(&format!("{DECLARED}{body}"), constants);
        let rest = text.strip_prefix(DECLARED).expect("declarations are kept");
        rest.split_whitespace().collect::<Vec<_>>().join(" ")
    }

    /// Constants and their defaults decide conditions; a condition on anything else stays as it is.
    #[test]
    fn constants_decide_conditions() {
        for (condition, expected) in [
            ("HOST", Some(false)),
            ("!HOST", Some(true)),
            ("HOST && x > 0.0", Some(false)),
            ("HOST || x > 0.0", None),
            ("!HOST || x > 0.0", Some(true)),
            ("!HOST && x > 0.0", None),
            ("GAPS == 2u", Some(true)),
            ("GAPS != 2u || (HOST && f(x, y))", Some(false)),
            ("GAPS < SKY", Some(true)),
            ("GAPS >= SKY && all(x > vec2f(0.0))", Some(false)),
            ("(HOST || GAPS > 1u) && !(GAPS <= 1u)", Some(true)),
            ("all(x == vec2f(GAPS))", None),
            ("x[GAPS] == 2u", None),
            ("UNKNOWN", None),
        ] {
            let body = format!("if {condition} {{ a(); }}");
            let expected = match expected {
                Some(true) => "{ a(); }",
                Some(false) => "",
                None => &body,
            };
            assert_eq!(pruned(&body, &[]), expected, "{condition}");
        }
        assert_eq!(pruned("if HOST { a(); }", &[("HOST", 1.0)]), "{ a(); }", "over its default");
    }

    /// Other branches take the place of one that is ruled out, and disappear after a certain one.
    #[test]
    fn other_branches_follow() {
        let chain = "if x { a(); } else if HOST { b(); } else { c(); }";
        assert_eq!(pruned(chain, &[]), "if x { a(); } else { c(); }");
        assert_eq!(pruned(chain, &[("HOST", 1.0)]), "if x { a(); } else { b(); }");
        let last = "if x { a(); } else if HOST { b(); } d();";
        assert_eq!(pruned(last, &[]), "if x { a(); } d();");
        let first = "if HOST { a(); } else if x { b(); } else { c(); }";
        assert_eq!(pruned(first, &[]), "if x { b(); } else { c(); }");
        assert_eq!(pruned(first, &[("HOST", 1.0)]), "{ a(); }");
        let nested = "if !HOST { if HOST { a(); } else { b(); } c(); }";
        assert_eq!(pruned(nested, &[]), "{ { b(); } c(); }");
    }

    /// `else` may stand anywhere between two blocks.
    #[test]
    fn other_branches_stand_anywhere() {
        let lines = "if HOST {\na();\n}\nelse\n{ b(); }";
        assert_eq!(pruned(lines, &[]), "{ b(); }");
        assert_eq!(pruned(lines, &[("HOST", 1.0)]), "{ a(); }");
        assert_eq!(pruned("if x { a(); }else if HOST { b(); }c();", &[]), "if x { a(); }c();");
        assert_eq!(pruned("if HOST { a(); } elsewhere();", &[]), "elsewhere();");
    }

    /// The end of a loop's `continuing` block is no branch.
    #[test]
    fn ends_of_loops_are_kept() {
        let body = "loop { a(); continuing { break if HOST; } } fn f() { b(); }";
        assert_eq!(pruned(body, &[]), body);
    }

    /// Text that is no WGSL is left to the parser of the device.
    #[test]
    fn unbalanced_text_is_left_to_the_parser() {
        for text in
            ["if true {", "if !HOST", "if HOST { } else", "} if HOST { a();", "if !HOST { é"]
        {
            pruned(text, &[]);
        }
    }

    /// Comments and names that contain a keyword are no conditions.
    #[test]
    fn comments_and_names_are_no_conditions() {
        assert_eq!(pruned("a(); // if HOST { b(); }\nc();", &[]), "a(); c();");
        assert_eq!(pruned("let elif = diff; if HOST { a(); }", &[]), "let elif = diff;");
    }
}
