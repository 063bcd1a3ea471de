//! Locations of values in a RON text, for the line, column and field of errors.
//!
//! ron reports the position of a parse error but not the field, and keeps neither for parsed
//! values; rules between fields can only be checked after parsing. This reads the same text a
//! second time, for positions alone, and is as lenient as possible, because ron has already checked
//! the syntax.

/// A value's location in a text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Located {
    /// Its field, such as `lights[0].direction[2]` or `paths["tour"][1].time`; empty for the whole.
    pub(super) field: String,
    /// Number of its first character.
    pub(super) start: usize,
    /// Number of the character after it.
    pub(super) end: usize,
}

/// Greatest nesting depth of located values: a scene needs six levels.
const GREATEST_DEPTH: usize = 32;

/// All values of a RON text, each after its children.
pub(super) fn values(text: &str) -> Vec<Located> {
    let mut reader = Reader { characters: text.chars().collect(), at: 0, found: Vec::new() };
    reader.value(String::new(), 0);
    reader.found
}

/// Line and column, both from 1, of a character.
pub(super) fn line_and_column(text: &str, character: usize) -> (usize, usize) {
    let before = || text.chars().take(character);
    let column = before().collect::<Vec<_>>().iter().rev().take_while(|c| **c != '\n').count() + 1;
    (before().filter(|c| *c == '\n').count() + 1, column)
}

/// The innermost value at a line and column, both from 1; a location just after a value belongs to
/// it if `with_end`.
pub(super) fn field_at(text: &str, line: usize, column: usize, with_end: bool) -> String {
    let line_start: usize = text
        .split_inclusive('\n')
        .take(line.saturating_sub(1))
        .map(|line| line.chars().count())
        .sum();
    let character = line_start + column.saturating_sub(1);
    let inside = values(text)
        .into_iter()
        .filter(|value| value.start <= character && character < value.end + usize::from(with_end));
    inside.min_by_key(|value| value.end - value.start).map(|value| value.field).unwrap_or_default()
}

struct Reader {
    characters: Vec<char>,
    at: usize,
    found: Vec<Located>,
}

impl Reader {
    fn peek(&self) -> Option<char> {
        self.characters.get(self.at).copied()
    }

    fn follows(&self, text: &str) -> bool {
        text.chars().enumerate().all(|(i, c)| self.characters.get(self.at + i) == Some(&c))
    }

    fn skip_while(&mut self, condition: impl Fn(char) -> bool) {
        while self.peek().is_some_and(&condition) {
            self.at += 1;
        }
    }

    /// Blanks, comments and `#![enable(…)]` lines.
    fn skip_blank(&mut self) {
        loop {
            self.skip_while(char::is_whitespace);
            if self.follows("//") || self.follows("#!") {
                self.skip_while(|c| c != '\n');
            } else if self.follows("/*") {
                let mut depth = 0;
                while self.at < self.characters.len() {
                    if self.follows("/*") {
                        (depth, self.at) = (depth + 1, self.at + 2);
                    } else if self.follows("*/") {
                        (depth, self.at) = (depth - 1, self.at + 2);
                    } else {
                        self.at += 1;
                    }
                    if depth == 0 {
                        break;
                    }
                }
            } else {
                return;
            }
        }
    }

    fn word(&mut self) -> String {
        let start = self.at;
        if self.peek() == Some('"') {
            self.at += 1;
            while let Some(c) = self.peek() {
                self.at += if c == '\\' { 2 } else { 1 };
                if c == '"' {
                    break;
                }
            }
        } else {
            self.skip_while(|c| !c.is_whitespace() && !"()[]{},:\"/".contains(c));
        }
        self.at = self.at.min(self.characters.len());
        self.characters[start..self.at].iter().collect()
    }

    fn value(&mut self, field: String, depth: usize) {
        self.skip_blank();
        let start = self.at;
        self.word();
        let end = self.at;
        self.skip_blank();
        match self.peek() {
            Some('(' | '[' | '{') if depth < GREATEST_DEPTH => self.elements(&field, depth),
            _ => self.at = end,
        }
        self.found.push(Located { field, start, end: self.at });
    }

    fn elements(&mut self, field: &str, depth: usize) {
        let open = self.peek();
        self.at += 1;
        for index in 0.. {
            self.skip_blank();
            match self.peek() {
                None => return,
                Some(')' | ']' | '}') => {
                    self.at += 1;
                    return;
                }
                Some(_) => {}
            }
            let start = self.at;
            let name = self.word();
            self.skip_blank();
            let named = open != Some('[') && self.peek() == Some(':');
            let inner = match (named, open) {
                (true, Some('{')) => format!("{field}[{name}]"),
                (true, _) if field.is_empty() => name,
                (true, _) => format!("{field}.{name}"),
                (false, _) => format!("{field}[{index}]"),
            };
            self.at = if named { self.at + 1 } else { start };
            self.value(inner, depth + 1);
            self.skip_blank();
            if self.peek() == Some(',') || self.at == start {
                // Also skips a character that nothing above consumed, so that the loop terminates
                // on every text.
                self.at += 1;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "// scene: (x: 1)\n(\n    geometry: Gltf(\"a,(b\\\".glb\"), /* no: 1 */\n    lights: [\n        Point(position: (0.0, -3.0, 0.5),\n              range: 1e3),\n    ],\n    paths: { \"tour\": [(time: 0.0)] },\n)\n";

    fn location(field: &str) -> Option<(usize, usize)> {
        values(TEXT)
            .iter()
            .find(|value| value.field == field)
            .map(|value| line_and_column(TEXT, value.start))
    }

    #[test]
    fn finds_fields_through_comments_strings_and_nesting() {
        assert_eq!(location(""), Some((2, 1)));
        assert_eq!(location("geometry"), Some((3, 15)));
        assert_eq!(location("geometry[0]"), Some((3, 20)));
        assert_eq!(location("lights[0].position"), Some((5, 25)));
        assert_eq!(location("lights[0].position[1]"), Some((5, 31)));
        assert_eq!(location("lights[0].range"), Some((6, 22)));
        assert_eq!(location("paths[\"tour\"][0].time"), Some((8, 30)));
        assert_eq!(location("no"), None);
        assert_eq!(field_at(TEXT, 6, 23, true), "lights[0].range");
        assert_eq!(field_at(TEXT, 5, 32, false), "lights[0].position[1]");
    }

    #[test]
    fn ends_on_any_text() {
        for text in [
            "",
            "(",
            "(a",
            "(a:",
            "{\"",
            "([{",
            ")]}",
            "/* /*",
            "(a:b:c:::,,,)",
            "\"\\",
            "(((((",
            "/",
            "(/)",
            "(\u{e9}: 1)",
        ] {
            values(text);
            field_at(text, 1, 1, true);
            field_at(text, 9, 9, false);
        }
        values(&"(".repeat(100_000));
        values(&"[a:".repeat(1000));
    }
}
