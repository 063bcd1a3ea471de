//! The page: one self-contained HTML file.

use std::fmt::Write as _;

use super::{Fact, RGBColor, escape};

/// Light and dark mode by the reader's preference; one column on a phone; wide elements scroll.
const STYLE: &str = include_str!("style.css");

/// A page under construction.
#[derive(Clone, Debug)]
pub(crate) struct Report {
    title: String,
    body: String,
    contents: Vec<String>,
}

impl Report {
    /// An empty page. All texts of a report are plain text and are escaped here.
    pub(crate) fn new(title: &str) -> Self {
        Self { title: title.to_owned(), body: String::new(), contents: Vec::new() }
    }

    /// Begins the next section.
    pub(crate) fn section(&mut self, heading: &str) {
        self.end_section();
        let heading = escape(heading);
        let number = self.contents.len() + 1;
        let _ = writeln!(self.body, "<section id=\"s{number}\">\n<h2>{heading}</h2>");
        self.contents.push(heading);
    }

    fn end_section(&mut self) {
        if !self.contents.is_empty() {
            self.body.push_str("</section>\n");
        }
    }

    /// The HTML file. With more than one section it starts with a list of them.
    pub(crate) fn render(mut self) -> String {
        self.end_section();
        let title = escape(&self.title);
        let mut contents = String::new();
        if self.contents.len() > 1 {
            contents.push_str("<nav><ul>\n");
            for (index, heading) in self.contents.iter().enumerate() {
                let _ = writeln!(contents, "<li><a href=\"#s{}\">{heading}</a></li>", index + 1);
            }
            contents.push_str("</ul></nav>\n");
        }
        format!(
            "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>{title}</title>\n<style>\n{STYLE}</style>\n</head>\n\
             <body>\n<main>\n<h1>{title}</h1>\n{contents}{}</main>\n</body>\n</html>\n",
            self.body
        )
    }

    /// A paragraph.
    pub(crate) fn paragraph(&mut self, text: &str) {
        let _ = writeln!(self.body, "<p>{}</p>", escape(text));
    }

    /// A highlighted paragraph.
    pub(crate) fn warning(&mut self, text: &str) {
        let _ =
            writeln!(self.body, "<p class=\"warning\"><strong>Note:</strong> {}</p>", escape(text));
    }

    /// Names and values.
    pub(crate) fn facts(&mut self, facts: &[Fact]) {
        self.body.push_str("<dl>\n");
        for (name, value) in facts {
            let (name, value) = (escape(name), escape(value));
            let _ = writeln!(self.body, "<div><dt>{name}</dt><dd>{value}</dd></div>");
        }
        self.body.push_str("</dl>\n");
    }

    /// A table. Cells that are numbers are aligned to the right; the first column names the row.
    pub(crate) fn table(&mut self, caption: &str, headers: &[&str], rows: &[Vec<String>]) {
        let numeric = |text: &str| text.parse::<f64>().is_ok();
        let is_number = |column: usize| {
            !rows.is_empty()
                && rows.iter().all(|row| row.get(column).is_some_and(|cell| numeric(cell)))
        };
        let class = |column: usize| if is_number(column) { " class=\"number\"" } else { "" };
        let classes: Vec<&str> = (0..headers.len()).map(class).collect();
        let _ = write!(
            self.body,
            "<div class=\"scroll\"><table>\n<caption>{}</caption>\n<thead><tr>",
            escape(caption)
        );
        for (header, class) in headers.iter().zip(&classes) {
            let _ = write!(self.body, "<th scope=\"col\"{class}>{}</th>", escape(header));
        }
        self.body.push_str("</tr></thead>\n<tbody>\n");
        for row in rows {
            self.body.push_str("<tr>");
            for (cell, class) in row.iter().zip(&classes) {
                let _ = write!(self.body, "<td{class}>{}</td>", escape(cell));
            }
            self.body.push_str("</tr>\n");
        }
        self.body.push_str("</tbody></table></div>\n");
    }

    /// Plots side by side where there is room: a caption and the SVG of each, as drawn by the
    /// functions of this module. The SVG is embedded unescaped.
    pub(crate) fn plots(&mut self, plots: &[(&str, String)]) {
        self.body.push_str("<div class=\"plots\">\n");
        for (caption, svg) in plots {
            let _ = writeln!(
                self.body,
                "<figure><div class=\"scroll\">{svg}</div><figcaption>{}</figcaption></figure>",
                escape(caption)
            );
        }
        self.body.push_str("</div>\n");
    }

    /// A legend of colours.
    pub(crate) fn legend<'a>(&mut self, entries: impl IntoIterator<Item = (&'a str, RGBColor)>) {
        self.body.push_str("<ul class=\"legend\">\n");
        for (name, RGBColor(red, green, blue)) in entries {
            let _ = writeln!(
                self.body,
                "<li><span style=\"background:#{red:02x}{green:02x}{blue:02x}\"></span>{}</li>",
                escape(name)
            );
        }
        self.body.push_str("</ul>\n");
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::BLUE;

    const NASTY: &str = "<script>alert(\"1\" & '2')</script>\0";

    #[test]
    fn texts_are_escaped() {
        let mut report = Report::new(NASTY);
        report.facts(&[(NASTY, NASTY.into())]);
        report.section(NASTY);
        report.paragraph(NASTY);
        report.warning(NASTY);
        report.facts(&[(NASTY, NASTY.into())]);
        report.table(NASTY, &[NASTY], &[vec![NASTY.into()]]);
        report.legend([(NASTY, BLUE)]);
        let html = report.render();
        assert!(!html.contains("<script") && !html.contains("alert(\"") && !html.contains('\0'));
        assert_eq!(
            html.matches("&lt;script&gt;alert(&quot;1&quot; &amp; &#39;2&#39;)").count(),
            13
        );
    }

    #[test]
    fn the_page_is_self_contained() {
        let mut report = Report::new("Report");
        report.section("First");
        report.section("Second");
        let html = report.render();
        assert!(
            html.starts_with("<!doctype html>")
                && html.contains("prefers-color-scheme: dark")
                && html.contains("name=\"viewport\"")
        );
        assert!(
            !html.contains("http://")
                && !html.contains("https://")
                && !html.contains("@import")
                && !html.contains("<link")
        );
        assert!(html.contains("<a href=\"#s2\">Second</a>"), "several sections get a list");
        assert_eq!((html.matches("<section").count(), html.matches("</section>").count()), (2, 2));
    }

    #[test]
    fn numbers_stand_to_the_right_and_words_to_the_left() {
        let mut report = Report::new("Table");
        report.table(
            "t",
            &["run", "watts"],
            &[vec!["7".into(), "1.5".into()], vec!["max".into(), "-2".into()]],
        );
        assert!(
            report.body.contains(
                "<th scope=\"col\">run</th><th scope=\"col\" class=\"number\">watts</th>"
            )
        );
    }
}
