//! What the pages of `limpid check` and `limpid report` have in common: each is one file that needs
//! nothing but itself, so that it can be kept and sent.

/// Colours, type and what is the same on all pages; a page's own rules come after.
const STYLE: &str = "
:root { color-scheme: light dark; --back: #fcfcfa; --text: #1b1d20; --dim: #666b71;
  --line: #e3e3df; --accent: #0a62c4 }
@media (prefers-color-scheme: dark) {
  :root { --back: #141619; --text: #e2e4e7; --dim: #969ca4; --line: #2d3137; --accent: #6db3ff } }
body { margin: 0; background: var(--back); color: var(--text);
  font: 16px/1.5 system-ui, sans-serif; font-variant-numeric: tabular-nums }
main { max-width: 66rem; margin: 0 auto; padding: 3rem 1.5rem 6rem }
h1 { font-size: 2rem; line-height: 1.2; margin: 0; letter-spacing: -.02em }
a { color: var(--accent); text-decoration: none }
a:hover { text-decoration: underline }
code { font-family: ui-monospace, monospace; font-size: .9em }
.wide { overflow-x: auto; margin: 1rem 0 }
table { border-collapse: collapse; font-size: .85rem; line-height: 1.35 }
figure { margin: 0; min-width: 0 }
.panels button { all: unset; display: block; width: 100%; cursor: zoom-in }
.panels button:focus-visible { outline: 2px solid var(--accent) }
dialog { border: 0; padding: 0; max-width: 100vw; max-height: 100vh; background: var(--back);
  color: var(--text) }
dialog::backdrop { background: #000d }
";

/// A page of this title, rules and contents; `script` shows its pictures in a dialog, if it has any.
pub(crate) fn page(title: &str, style: &str, content: &str, script: Option<&str>) -> String {
    let dialog = script.map_or_else(String::new, |script| {
        format!(
            "<dialog><img src=\"data:,\" alt=\"\"><p></p></dialog>\n<script>{script}</script>\n"
        )
    });
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>{title}</title>\n<style>{STYLE}{style}</style>\n</head>\n<body>\n<main>\n\
         <h1>{title}</h1>\n{content}</main>\n{dialog}</body>\n</html>\n"
    )
}

#[cfg(test)]
pub(crate) mod tests {
    /// Fails if a page fetches anything, has more or fewer pictures, or an element without an end.
    #[track_caller]
    pub(crate) fn assert_self_contained(page: &str, pictures: usize) {
        for absent in ["http:", "https:", "<script src", "<link", "@import", "url("] {
            assert!(!page.contains(absent), "{absent}");
        }
        let sources = page.split("src=\"").skip(1);
        assert!(sources.clone().all(|source| source.starts_with("data:")));
        assert_eq!(sources.count(), pictures);
        for tag in [
            "section", "table", "figure", "svg", "div", "tr", "td", "g", "p", "ul", "li", "dl",
            "dialog",
        ] {
            let opened = page.matches(&format!("<{tag}>")).count()
                + page.matches(&format!("<{tag} ")).count();
            assert_eq!(opened, page.matches(&format!("</{tag}>")).count(), "{tag}");
        }
    }
}
