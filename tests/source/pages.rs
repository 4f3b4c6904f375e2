//! Links of the pages: every relative link leads to a file that is there, and to a heading that it has.

use std::collections::HashMap;
use std::fs;
use std::path::{Path, PathBuf};

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

/// The pages: those at the root, in `docs` and in `.github`.
fn pages() -> Vec<PathBuf> {
    let markdown = |folder: PathBuf| {
        let entries = fs::read_dir(folder).expect("the folder is there");
        entries.map(|entry| entry.expect("it can be listed").path())
    };
    let root = Path::new(ROOT);
    let all = markdown(root.into()).chain(markdown(root.join("docs")));
    let all = all.chain(markdown(root.join(".github")));
    all.filter(|path| path.extension().is_some_and(|extension| extension == "md")).collect()
}

/// Lines of a page outside blocks of code.
fn prose(text: &str) -> impl Iterator<Item = &str> {
    let mut in_code = false;
    text.lines().filter(move |line| {
        let fence = line.trim_start().starts_with("```");
        in_code ^= fence;
        !in_code && !fence
    })
}

/// Targets of the links and pictures of a page.
fn targets(text: &str) -> Vec<String> {
    let mut found = Vec::new();
    for line in prose(text) {
        let ends = [("](", ')'), ("src=\"", '"'), ("href=\"", '"')];
        for (begin, end) in ends {
            for rest in line.split(begin).skip(1) {
                found.extend(rest.split(end).next().map(str::to_owned));
            }
        }
    }
    found
}

/// Names of the headings of a page, as GitHub makes them.
fn anchors(text: &str) -> Vec<String> {
    let mut times: HashMap<String, usize> = HashMap::new();
    let headings = prose(text).filter_map(|line| line.strip_prefix('#'));
    let name = |heading: &str| {
        let heading = heading.trim_start_matches('#').trim().to_lowercase();
        let kept = heading.chars().filter(|&c| c.is_alphanumeric() || " -_".contains(c));
        kept.map(|c| if c == ' ' { '-' } else { c }).collect::<String>()
    };
    headings
        .map(|heading| {
            let name = name(heading);
            let again = times.entry(name.clone()).or_default();
            *again += 1;
            if *again == 1 { name } else { format!("{name}-{}", *again - 1) }
        })
        .collect()
}

/// Returns the problem with a link of `page`, if it has one.
fn problem(page: &Path, target: &str) -> Option<String> {
    if target.contains("://") || target.starts_with("mailto:") {
        return None;
    }
    let (path, anchor) = target.split_once('#').unwrap_or((target, ""));
    let file = match path {
        "" => page.to_owned(),
        _ => page.parent().expect("a page is in a folder").join(path),
    };
    if !file.exists() {
        return Some(format!("{}: {target}: there is no such file", page.display()));
    }
    if anchor.is_empty() || file.extension().is_none_or(|extension| extension != "md") {
        return None;
    }
    let text = fs::read_to_string(&file).expect("the page can be read");
    let known = anchors(&text).iter().any(|known| known == anchor);
    (!known).then(|| format!("{}: {target}: there is no such heading", page.display()))
}

#[test]
fn links_of_pages_lead_somewhere() {
    let mut links = 0;
    let mut problems = Vec::new();
    for page in pages() {
        let targets = targets(&fs::read_to_string(&page).expect("the page can be read"));
        links += targets.len();
        problems.extend(targets.iter().filter_map(|target| problem(&page, target)));
    }
    assert!(links > 50, "{links} links are found");
    assert!(problems.is_empty(), "{}", problems.join("\n"));
}

#[test]
fn dead_links_are_found() {
    let page = Path::new(ROOT).join("README.md");
    let text = "# A `b` c, d\n# A b c d\n[x](y.md#z) ![p](docs/p.png)\n```\n# no\n[n](n)\n```\n";
    assert_eq!(anchors(text), ["a-b-c-d", "a-b-c-d-1"]);
    assert_eq!(targets(text), ["y.md#z", "docs/p.png"]);
    assert!(problem(&page, "nowhere.md").is_some());
    assert!(problem(&page, "README.md#no-such-heading").is_some());
    assert_eq!(problem(&page, "Cargo.toml"), None);
    assert_eq!(problem(&page, "https://example.org/nowhere"), None);
}

/// README.md and `docs` are small enough to be read.
#[test]
fn pages_stay_short() {
    let read = |path: &Path| fs::read_to_string(path).expect("the page can be read");
    let root = Path::new(ROOT);
    let readme = read(&root.join("README.md"));
    let docs = pages().into_iter().filter(|path| path.starts_with(root.join("docs")));
    let bytes = readme.len() + docs.map(|path| read(&path).len()).sum::<usize>();
    assert!(bytes <= 80_000, "the pages have {bytes} bytes; 80,000 are the most");
    let lines = readme.lines().count();
    assert!(lines <= 150, "README.md has {lines} lines; 150 are the most");
}
