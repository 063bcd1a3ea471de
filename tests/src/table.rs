//! Tables in Markdown, for terminals and documents alike.

/// A table whose columns are as wide as their widest cell. The first column is left-aligned; the
/// others hold numbers and are right-aligned.
pub fn markdown<Cell: AsRef<str>>(headers: &[&str], rows: &[Vec<Cell>]) -> String {
    let width = |column: usize| {
        let cells =
            rows.iter().filter_map(|row| row.get(column)).map(|cell| cell.as_ref().chars().count());
        cells.chain([headers[column].chars().count(), 3]).max().unwrap_or(3)
    };
    let widths: Vec<usize> = (0..headers.len()).map(width).collect();
    let cell = |column: usize, text: &str| {
        let width = widths[column];
        if column == 0 { format!(" {text:width$} |") } else { format!(" {text:>width$} |") }
    };
    let line = |cells: &mut dyn Iterator<Item = &str>| {
        cells
            .enumerate()
            .map(|(column, text)| cell(column, text))
            .fold("|".to_owned(), |line, cell| line + &cell)
    };
    let rule = widths.iter().enumerate().map(|(column, width)| match column {
        0 => format!("{}|", "-".repeat(width + 2)),
        _ => format!("{}:|", "-".repeat(width + 1)),
    });
    let mut lines = vec![
        line(&mut headers.iter().copied()),
        rule.fold("|".to_owned(), |line, cell| line + &cell),
    ];
    lines.extend(rows.iter().map(|row| line(&mut row.iter().map(AsRef::as_ref))));
    lines.join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_as_wide_as_their_widest_cell() {
        let rows = [vec!["naive-rsm", "1.0"], vec!["ours", "12.25"]];
        let expected = "| method    |  cost |\n|-----------|------:|\n| naive-rsm |   1.0 |\n| ours      | 12.25 |";
        assert_eq!(markdown(&["method", "cost"], &rows), expected);
    }
}
