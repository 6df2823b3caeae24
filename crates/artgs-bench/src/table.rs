//! Tables, independent of Markdown and HTML.

use crate::collect::Failures;
use crate::metric::Metric;
use crate::stats::Aggregate;

/// Cell of a missing number.
pub(crate) const NOTHING: &str = "-";
/// Cell of a number if every run failed.
pub(crate) const FAILED: &str = "F";
/// Rows of the long tables of a report at most; how many more there are is stated.
pub(crate) const MOST: usize = 50;

/// Where the numbers of a row come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Origin {
    /// This benchmark, on the object of the table.
    Ours,
    /// This benchmark, on another object that replaces the one of the table.
    StandIn,
    /// The paper.
    Paper,
}

/// A row.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Row {
    /// Plain text, as many as columns.
    pub cells: Vec<String>,
    /// Where its numbers come from.
    pub origin: Origin,
}

/// A table with its heading.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Table {
    /// Heading.
    pub title: String,
    /// Paragraphs before it.
    pub notes: Vec<String>,
    /// Names of the columns.
    pub head: Vec<String>,
    /// Rows.
    pub rows: Vec<Row>,
}

impl Table {
    pub(crate) fn new(title: impl Into<String>, head: Vec<String>) -> Self {
        Self { title: title.into(), notes: Vec::new(), head, rows: Vec::new() }
    }

    pub(crate) fn push(&mut self, origin: Origin, cells: Vec<String>) {
        debug_assert_eq!(cells.len(), self.head.len(), "{}", self.title);
        self.rows.push(Row { cells, origin });
    }

    /// Removes empty columns after the first `keep`.
    pub(crate) fn without_empty_columns(mut self, keep: usize) -> Self {
        let used: Vec<bool> = (0..self.head.len())
            .map(|c| c < keep || self.rows.iter().any(|r| r.cells[c] != NOTHING && r.cells[c] != FAILED))
            .collect();
        let strip = |cells: &mut Vec<String>| {
            let mut column = 0..;
            cells.retain(|_| column.next().is_some_and(|c: usize| used[c]));
        };
        strip(&mut self.head);
        self.rows.iter_mut().for_each(|r| strip(&mut r.cells));
        self
    }
}

/// A table without rows; an empty note is none.
pub(crate) fn table(title: &str, note: &str, head: &[&str]) -> Table {
    let mut table = Table::new(title, head.iter().map(ToString::to_string).collect());
    table.notes = Some(note).filter(|note| !note.is_empty()).map(String::from).into_iter().collect();
    table
}

/// Appends as many rows as a table may have, and states how many there are.
pub(crate) fn fill<T>(mut table: Table, items: &[T], cells: impl Fn(&T) -> Vec<String>) -> Table {
    for item in items.iter().take(MOST) {
        table.push(Origin::Ours, cells(item));
    }
    if items.len() > MOST {
        table.notes.push(format!("{MOST} of {}.", items.len()));
    }
    table
}

/// A mean with its standard deviation and the number of failed runs: `0.03±0.01 (1 F)`.
pub(crate) fn number(value: Option<Aggregate>, failures: Failures, metric: Metric, more_digits: usize) -> String {
    let digits = metric.digits() + more_digits;
    match value {
        None if failures.runs > 0 && failures.wrong() >= failures.runs => FAILED.into(),
        None => NOTHING.into(),
        Some(a) => {
            let std = a.std.map(|s| format!("±{s:.digits$}")).unwrap_or_default();
            let wrong = if failures.wrong() > 0 { format!(" ({} F)", failures.wrong()) } else { String::new() };
            format!("{:.digits$}{std}{wrong}", a.mean)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_contain_spread_and_failures() {
        let a = |std, runs| Some(Aggregate { mean: 0.034, std, runs });
        let f = |runs, failed| Failures { runs, failed, ..Failures::default() };
        assert_eq!(number(a(None, 1), f(1, 0), Metric::AxisAngle, 0), "0.03");
        assert_eq!(number(a(Some(0.01), 2), f(3, 1), Metric::AxisAngle, 1), "0.034±0.010 (1 F)");
        assert_eq!(number(None, f(2, 2), Metric::AxisAngle, 0), "F");
        let without = Failures { runs: 3, missing_part: 1, wrong_type: 1, ..Failures::default() };
        assert_eq!(number(a(None, 2), without, Metric::AxisAngle, 0), "0.03 (2 F)");
        let all_missing = Failures { runs: 1, missing_part: 1, ..Failures::default() };
        assert_eq!(number(None, all_missing, Metric::AxisAngle, 0), "F");
        assert_eq!(number(None, f(2, 0), Metric::Lpips, 0), "-");
        assert_eq!(number(None, f(0, 0), Metric::Lpips, 0), "-");
    }

    #[test]
    fn columns_without_anything_go() {
        let mut t = Table::new("t", ["a", "b", "c"].map(String::from).to_vec());
        t.push(Origin::Ours, ["x", "-", "1"].map(String::from).to_vec());
        t.push(Origin::Ours, ["-", "F", "-"].map(String::from).to_vec());
        let t = t.without_empty_columns(1);
        assert_eq!(t.head, ["a", "c"]);
        assert_eq!(t.rows[1].cells, ["-", "-"]);
    }
}
