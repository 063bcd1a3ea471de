//! Lines of text files that apps append to.

/// `text` without the byte order mark that some editors write.
pub(crate) fn unmarked(text: &str) -> &str {
    text.strip_prefix('\u{feff}').unwrap_or(text)
}

/// The lines of `text`, each with its number from 1 and without white space at its end. Leaves out an
/// unterminated last line, as a crash or a full disk leaves it.
pub(crate) fn whole_lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let lines = text.split_inclusive('\n').filter(|line| line.ends_with('\n'));
    lines.map(str::trim_end).enumerate().map(|(index, line)| (index + 1, line))
}

/// The beginning of `text`, for an error: at most `most` characters of its first line.
pub(crate) fn quote(text: &str, most: usize) -> String {
    text.lines().next().unwrap_or_default().chars().take(most).collect()
}
