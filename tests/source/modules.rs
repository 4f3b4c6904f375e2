//! The files of every crate depend on each other without cycles, by their `use` declarations and paths,
//! which gives readers an order.
//!
//! There is no cycle between folders, nor between the files of a folder. A file and the folder of the
//! same name are one node: they may use each other. The crate root is a file like others: what it uses must not
//! use it.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

/// Source text by module, such as `passes/splat`; `""` is the crate root.
type Sources = BTreeMap<String, String>;

fn read(folder: &Path, module: &str, sources: &mut Sources) {
    for entry in fs::read_dir(folder).expect("a folder of sources") {
        let path = entry.expect("an entry").path();
        let name = path.file_stem().and_then(|name| name.to_str()).expect("a name").to_owned();
        let inner = if module.is_empty() { name.clone() } else { format!("{module}/{name}") };
        if path.is_dir() {
            read(&path, &inner, sources);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            let root = module.is_empty() && ["lib", "main"].contains(&name.as_str());
            let module = if root { String::new() } else { inner };
            sources.insert(module, fs::read_to_string(&path).expect("a source file"));
        }
    }
}

/// Strips comments and unit tests.
fn code(text: &str) -> String {
    let text = text.split("#[cfg(test)]\nmod tests {").next().unwrap_or_default();
    let lines = text.lines().map(|line| line.split("//").next().unwrap_or_default());
    lines.collect::<Vec<_>>().join("\n")
}

/// Expands the tree of a `use` declaration: `a::{b, c::{d}}` becomes `a::b` and `a::c::d`.
fn expand(prefix: &str, tree: &str, paths: &mut Vec<String>) {
    let (mut depth, mut start) = (0, 0);
    for (at, c) in tree.char_indices().chain([(tree.len(), ',')]) {
        match c {
            '{' => depth += 1,
            '}' => depth -= 1,
            ',' if depth == 0 => {
                let part = tree[start..at].trim();
                start = (at + 1).min(tree.len());
                match part.split_once('{') {
                    Some((path, inner)) => {
                        let inner = inner.trim_end().strip_suffix('}').expect("a closed brace");
                        expand(&format!("{prefix}{path}"), inner, paths);
                    }
                    None if part.is_empty() => {}
                    None => {
                        let path = part.split(" as ").next().unwrap_or(part);
                        paths.push(format!("{prefix}{}", path.trim()));
                    }
                }
            }
            _ => {}
        }
    }
}

/// All paths in a file that may refer to another file of the crate.
fn paths(text: &str) -> Vec<String> {
    let code = code(text);
    let mut paths = Vec::new();
    for (at, _) in code.match_indices("use ") {
        let before = code[..at].chars().next_back();
        if before.is_none_or(|c| c.is_whitespace()) {
            let tree = code[at + 4..].split(';').next().unwrap_or_default();
            expand("", tree, &mut paths);
        }
    }
    for start in ["crate::", "super::", "self::"] {
        for (at, _) in code.match_indices(start) {
            let end = code[at..].find(|c: char| c != ':' && c != '_' && !c.is_alphanumeric());
            let path = &code[at..end.map_or(code.len(), |end| at + end)];
            paths.push(path.trim_end_matches(':').to_owned());
        }
    }
    paths
}

/// Resolves a path in a file to a module of the crate.
fn target(sources: &Sources, from: &str, path: &str) -> Option<String> {
    let mut base: Vec<&str> = from.split('/').filter(|part| !part.is_empty()).collect();
    let mut parts = path.split("::").peekable();
    match parts.peek() {
        Some(&"crate") => {
            base.clear();
            parts.next();
        }
        Some(&("super" | "self")) => {
            while let Some(part) = parts.next_if(|part| ["super", "self"].contains(part)) {
                if part == "super" {
                    base.pop();
                }
            }
        }
        Some(first) => {
            let inner = base.iter().chain([first]).copied().collect::<Vec<_>>().join("/");
            sources.get(&inner)?;
        }
        None => return None,
    }
    let mut found = base.join("/");
    for part in parts {
        let inner = if found.is_empty() { part.to_owned() } else { format!("{found}/{part}") };
        if !sources.contains_key(&inner) {
            break;
        }
        found = inner;
    }
    Some(found)
}

/// Finds a cycle among the nodes of any folder, as `a -> b -> a`.
fn cycle(sources: &Sources) -> Option<String> {
    let mut edges = BTreeSet::new();
    for (from, text) in sources {
        let targets = paths(text).into_iter().filter_map(|path| target(sources, from, &path));
        edges.extend(targets.map(|to| (from.clone(), to)));
    }
    let mut folders: BTreeSet<String> = [String::new()].into();
    folders.extend(sources.keys().filter_map(|module| Some(module.rsplit_once('/')?.0.to_owned())));
    folders.iter().find_map(|folder| {
        let prefix = if folder.is_empty() { String::new() } else { format!("{folder}/") };
        let node = |module: &str| -> Option<String> {
            if module.is_empty() && folder.is_empty() {
                return Some("the crate root".to_owned());
            }
            let name = module.strip_prefix(&prefix)?.split('/').next()?;
            (!name.is_empty()).then(|| format!("{prefix}{name}"))
        };
        let mut graph: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
        for (from, to) in &edges {
            if let (Some(from), Some(to)) = (node(from), node(to))
                && from != to
            {
                graph.entry(from).or_default().insert(to);
            }
        }
        graph.keys().find_map(|start| path_back(&graph, start))
    })
}

/// Finds a path along the edges from a node to itself.
fn path_back(graph: &BTreeMap<String, BTreeSet<String>>, start: &str) -> Option<String> {
    let mut seen = BTreeSet::new();
    let mut paths = vec![vec![start.to_owned()]];
    while let Some(path) = paths.pop() {
        for next in graph.get(path.last()?).into_iter().flatten() {
            if next == start {
                return Some(path.join(" -> ") + " -> " + start);
            }
            if seen.insert(next.clone()) {
                paths.push(path.iter().chain([next]).cloned().collect());
            }
        }
    }
    None
}

#[test]
fn files_depend_on_each_other_without_cycles() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let crates = fs::read_dir(root.join("crates")).expect("the crates");
    let crates = crates.map(|entry| entry.expect("a crate").path());
    let mut count = 0;
    for folder in crates.chain([root.to_owned()]) {
        let mut sources = Sources::new();
        read(&folder.join("src"), "", &mut sources);
        count += sources.len();
        let found = cycle(&sources);
        assert!(found.is_none(), "{}: {}", folder.display(), found.unwrap_or_default());
    }
    assert!(count > 150, "{count} files");
}

/// Negative test: the check finds cycles in any notation, and treats a file and its folder as one node.
#[test]
fn planted_cycles_are_found() {
    let sources = |files: &[(&str, &str)]| -> Sources {
        files.iter().map(|(module, text)| ((*module).into(), (*text).into())).collect()
    };
    let planted: [&[(&str, &str)]; 5] = [
        &[("a", "use crate::b::B;"), ("b", "fn f() { crate::a::g() }")],
        &[("a/x", "use super::super::b;"), ("a", ""), ("b", "use crate::{c, a::{x::X}};")],
        &[("a", "mod x;\nmod y;"), ("a/x", "use super::y::Y;"), ("a/y", "use super::x::{X as Z};")],
        &[("a", "use crate::b;"), ("b", "use crate::c;"), ("c", "use crate::a;")],
        &[("", "mod a;\nuse a::A;"), ("a", "use crate::Top;")],
    ];
    for files in planted {
        assert!(cycle(&sources(files)).is_some(), "{files:?}");
    }
    let clean: [&[(&str, &str)]; 3] = [
        &[("a", "mod x;\nuse x::X;"), ("a/x", "use super::A;")],
        &[
            ("a", "use crate::b;"),
            ("b", "// use crate::a;\n#[cfg(test)]\nmod tests {use crate::a;}"),
        ],
        &[("", "mod a;\npub use a::A;"), ("a", "use crate::a::x::X;"), ("a/x", "use crate::a::A;")],
    ];
    for files in clean {
        assert_eq!(cycle(&sources(files)), None, "{files:?}");
    }
}
