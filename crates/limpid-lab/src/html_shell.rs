//! The HTML shell of the pages of `limpid check` and `limpid report`: each page is one
//! self-contained file, so that it can be archived and sent.

/// The style sheet that all pages share; a page's own rules follow it.
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

/// Assembles a page from its title, style rules and contents; `script` shows its pictures in a
/// dialog, if it has any.
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
    /// Fails if a page loads an external resource, has more or fewer than `pictures` pictures, or
    /// has an unclosed element.
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
