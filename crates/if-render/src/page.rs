//! Reports as single HTML files with embedded style and pictures.

use crate::viewer::{self, Viewer};
use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use serde::Serialize;

const STYLE: &str = "\
:root{color-scheme:light dark}
body{font:15px/1.45 system-ui,sans-serif;margin:2rem auto;max-width:72rem;padding:0 1rem}
h1{font-size:1.5rem}h2{font-size:1.15rem;margin-top:2rem}
table{border-collapse:collapse;margin:.5rem 0}
th,td{padding:.2rem .7rem;text-align:left;border-bottom:1px solid #8884}
td.n{text-align:right;font-variant-numeric:tabular-nums}
figure{margin:.5rem 1rem .5rem 0;display:inline-block}figcaption{color:#888}
img{max-width:100%;height:auto}pre{overflow:auto;background:#8881;padding:.7rem}
.good{color:#197a3d}.bad{color:#c22}";

/// An HTML report: one file that needs no network.
///
/// # Examples
///
/// ```
/// let mut page = if_render::Page::new("A run");
/// page.heading("Times").table(&["what", "seconds"], &[vec!["all".into(), "1.5".into()]]);
/// assert!(page.html().contains(">1.5</td>"));
/// ```
#[derive(Clone, Debug)]
pub struct Page {
    title: String,
    body: String,
    has_viewer: bool,
}

impl Page {
    /// A page that begins with its title.
    pub fn new(title: &str) -> Self {
        let title = escaped(title);
        Self { body: format!("<h1>{title}</h1>\n"), title, has_viewer: false }
    }

    /// A heading.
    pub fn heading(&mut self, text: &str) -> &mut Self {
        self.body += &format!("<h2>{}</h2>\n", escaped(text));
        self
    }

    /// A paragraph.
    pub fn text(&mut self, text: &str) -> &mut Self {
        self.body += &format!("<p>{}</p>\n", escaped(text));
        self
    }

    /// A paragraph, in green if `good`, else in red.
    pub fn verdict(&mut self, good: bool, text: &str) -> &mut Self {
        let class = if good { "good" } else { "bad" };
        self.body += &format!("<p class=\"{class}\"><strong>{}</strong></p>\n", escaped(text));
        self
    }

    /// A table. Numbers are aligned to the right. A row may be shorter than the head.
    pub fn table(&mut self, head: &[&str], rows: &[Vec<String>]) -> &mut Self {
        self.body += "<table><tr>";
        head.iter().for_each(|cell| self.body += &format!("<th>{}</th>", escaped(cell)));
        self.body += "</tr>\n";
        for row in rows {
            self.body += "<tr>";
            for cell in row {
                let unit =
                    [" %", " mm", " s"].iter().find_map(|u| cell.strip_suffix(u)).unwrap_or(cell);
                let class = if unit.parse::<f64>().is_ok() { " class=\"n\"" } else { "" };
                self.body += &format!("<td{class}>{}</td>", escaped(cell));
            }
            self.body += "</tr>\n";
        }
        self.body += "</table>\n";
        self
    }

    /// A picture, as the bytes of a PNG file.
    pub fn picture(&mut self, caption: &str, png: &[u8]) -> &mut Self {
        let caption = escaped(caption);
        self.body += &format!(
            "<figure><img alt=\"{caption}\" src=\"data:image/png;base64,{}\"><figcaption>{caption}</figcaption></figure>\n",
            BASE64_STANDARD.encode(png)
        );
        self
    }

    /// Layers to turn, cut and compare: mouse, touch or keys. Needs WebGL 2 and says so where that is
    /// missing; a page should also have pictures.
    pub fn viewer(&mut self, viewer: &Viewer<'_>) -> &mut Self {
        self.body += &viewer.html();
        self.has_viewer = true;
        self
    }

    /// Parameters or records, as JSON.
    pub fn json(&mut self, value: &impl Serialize) -> &mut Self {
        let text = serde_json::to_string_pretty(value).unwrap_or_else(|e| e.to_string());
        self.body += &format!("<pre>{}</pre>\n", escaped(&text));
        self
    }

    /// The whole page.
    pub fn html(&self) -> String {
        let (style, script) = if self.has_viewer {
            (viewer::STYLE, format!("<script>\n{}</script>\n", viewer::SCRIPT))
        } else {
            ("", String::new())
        };
        format!(
            "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\
             <meta name=\"viewport\" content=\"width=device-width\">\
             <title>{}</title><style>{STYLE}\n{style}</style></head>\n\
             <body>\n{}{script}</body></html>\n",
            self.title, self.body
        )
    }
}

/// Escapes text for HTML.
fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out += "&amp;",
            '<' => out += "&lt;",
            '>' => out += "&gt;",
            '"' => out += "&quot;",
            '\'' => out += "&#39;",
            c => out.push(c),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn content_never_becomes_markup_and_nothing_is_fetched() {
        let mut page = Page::new("<a & b>");
        page.heading("\"h\"")
            .text("<script>")
            .verdict(true, "well")
            .table(&["<"], &[vec!["'".into()]])
            .picture("p", b"png");
        page.json(&serde_json::json!({"<k>": 1}));
        let html = page.html();
        assert!(
            !html.contains("<script>")
                && !html.contains("<k>")
                && html.contains("&lt;a &amp; b&gt;")
        );
        assert!(!html.contains("http:") && !html.contains("https:"));
        assert!(html.contains("data:image/png;base64,cG5n"));
    }
}
