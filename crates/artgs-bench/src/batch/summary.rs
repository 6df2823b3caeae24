//! Numbers of a batch.

use super::causes::{Cause, causes};
use super::changes::Changes;
use super::row::Row;
use serde::Serialize;
use std::collections::BTreeMap;

/// How a number is distributed over captures. Quantiles are interpolated linearly.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Spread {
    /// Captures that have the number.
    pub count: usize,
    /// Least value.
    pub min: f64,
    /// A tenth of the values is below.
    pub p10: f64,
    /// Half of the values is below.
    pub median: f64,
    /// Mean.
    pub mean: f64,
    /// A tenth of the values is above.
    pub p90: f64,
    /// A hundredth of the values is above.
    pub p99: f64,
    /// Largest value.
    pub max: f64,
}

impl Spread {
    /// The distribution of values; none without any.
    pub(super) fn of(mut values: Vec<f64>) -> Option<Self> {
        values.sort_by(f64::total_cmp);
        let (min, max) = (*values.first()?, *values.last()?);
        let quantile = |share: f64| {
            let place = share * (values.len() - 1) as f64;
            let (below, above) = (place.floor() as usize, place.ceil() as usize);
            values[below] + (values[above] - values[below]) * (place - below as f64)
        };
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let [p10, median, p90, p99] = [0.1, 0.5, 0.9, 0.99].map(quantile);
        Some(Self { count: values.len(), min, p10, median, mean, p90, p99, max })
    }
}

/// What became of the captures of a batch.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// Rows.
    pub captures: usize,
    /// Rows with a replica.
    pub done: usize,
    /// Rows without one.
    pub failed: usize,
    /// Failures for which the same command may succeed later.
    pub retry: usize,
    /// Wall-clock seconds of all runs together.
    pub seconds: f64,
    /// Processor seconds of all runs together; none if no row has them.
    pub cpu_seconds: Option<f64>,
    /// Price of the processor seconds; none without a price.
    pub cost: Option<f64>,
    /// Failures by cause, the largest group first.
    pub causes: Vec<Cause>,
    /// Distributions by the names of the fields. Times and memory are of finished captures.
    pub spreads: BTreeMap<String, Spread>,
    /// Distributions of scores by their names.
    pub scores: BTreeMap<String, Spread>,
    /// Differences to an earlier table.
    pub changes: Option<Changes>,
}

/// A number of a row that is none if the row does not have it.
pub(super) type Field = fn(&Row) -> Option<f64>;

/// Numbers whose distribution is shown: name of the field, name for people.
pub(super) const FIELDS: [(&str, &str, Field); 5] = [
    ("seconds", "wall-clock time, s", |row| row.seconds),
    ("cpu_seconds", "processor time, s", |row| row.cpu_seconds),
    ("peak_memory_mib", "peak memory, MiB", |row| row.peak_memory_mib),
    ("confidence", "least confidence of a joint", |row| row.confidence),
    ("warnings", "warnings", |row| row.warnings),
];

impl Summary {
    /// Numbers of a table; with an earlier one, the differences; `price` is that of a processor hour.
    pub fn new(rows: &[Row], before: Option<&[Row]>, price: Option<f64>) -> Self {
        let failed = || rows.iter().filter(|row| !row.done);
        let cpu: Vec<f64> = rows.iter().filter_map(|row| row.cpu_seconds).collect();
        let cpu_seconds = (!cpu.is_empty()).then(|| cpu.iter().sum::<f64>());
        let spread =
            |(name, _, field): &(&str, &str, Field)| Some(((*name).to_string(), Spread::of(of_done(rows, *field))?));
        Self {
            captures: rows.len(),
            done: rows.len() - failed().count(),
            failed: failed().count(),
            retry: failed().filter(|row| row.retry).count(),
            seconds: rows.iter().filter_map(|row| row.seconds).sum(),
            cpu_seconds,
            cost: price.zip(cpu_seconds).map(|(price, seconds)| price * seconds / 3600.0),
            causes: causes(rows),
            spreads: FIELDS.iter().filter_map(spread).collect(),
            scores: scores(rows),
            changes: before.map(|before| Changes::new(before, rows)),
        }
    }
}

/// A number of all finished captures that have it.
pub(super) fn of_done(rows: &[Row], field: Field) -> Vec<f64> {
    rows.iter().filter(|row| row.done).filter_map(field).collect()
}

fn scores(rows: &[Row]) -> BTreeMap<String, Spread> {
    let mut values: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
    for (name, value) in rows.iter().flat_map(|row| &row.scores) {
        values.entry(name).or_default().push(*value);
    }
    values.into_iter().filter_map(|(name, values)| Some((name.to_string(), Spread::of(values)?))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spreads_of_known_values() {
        let spread = Spread::of((0..=100).rev().map(f64::from).collect()).unwrap();
        assert_eq!((spread.count, spread.min, spread.max, spread.mean), (101, 0.0, 100.0, 50.0));
        assert_eq!((spread.p10, spread.median, spread.p90, spread.p99), (10.0, 50.0, 90.0, 99.0));
        assert_eq!(Spread::of(vec![1.0, 2.0]).unwrap().median, 1.5);
        assert_eq!(Spread::of(Vec::new()), None);
    }

    #[test]
    fn totals_of_a_known_table() {
        let row = |id: &str, done, seconds, cpu| Row {
            id: id.into(),
            done,
            retry: id == "c",
            seconds: Some(seconds),
            cpu_seconds: cpu,
            scores: BTreeMap::from([("psnr".into(), seconds)]),
            ..Row::default()
        };
        let rows = [row("a", true, 10.0, Some(1800.0)), row("b", false, 1.0, None), row("c", false, 2.0, Some(5400.0))];
        let summary = Summary::new(&rows, None, Some(0.04));
        assert_eq!((summary.captures, summary.done, summary.failed, summary.retry), (3, 1, 2, 1));
        assert_eq!((summary.seconds, summary.cpu_seconds, summary.cost), (13.0, Some(7200.0), Some(0.08)));
        assert_eq!(summary.spreads["seconds"].max, 10.0, "failures are not part of the times");
        assert_eq!(summary.scores["psnr"].count, 3);
        assert!(!summary.spreads.contains_key("confidence"));
    }
}
