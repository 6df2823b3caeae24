//! Records by variant and object, with means and failures.

use crate::item::Item;
use crate::metric::{At, Metric};
use crate::paper::PaperObject;
use crate::record::{Facts, Record};
use crate::stats::{Aggregate, aggregate};
use crate::variant::Variant;
use serde::Serialize;

/// A variant, as shown in tables.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct VariantInfo {
    /// Name.
    pub name: String,
    /// One sentence.
    pub description: String,
}

/// An object, as shown in tables.
#[derive(Clone, Debug, PartialEq)]
pub struct ObjectInfo {
    /// Name.
    pub name: String,
    /// Parts, the static one included, where known.
    pub parts: Option<usize>,
    /// Object of the paper that it is or stands for.
    pub stands_for: Option<&'static PaperObject>,
    /// True if it is that object.
    pub same_object: bool,
}

impl ObjectInfo {
    /// State whose surfaces the paper scores; the mean of both for other objects.
    pub fn reported(&self) -> At {
        self.stands_for.map_or(At::Mean, |o| o.reported)
    }
}

/// Number of failed runs of an object, by kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Failures {
    /// All runs.
    pub runs: usize,
    /// Runs without a replica: crash, error, time limit.
    pub failed: usize,
    /// Runs with a replica that lacks a part.
    pub missing_part: usize,
    /// Runs with a replica that has a joint of the wrong type.
    pub wrong_type: usize,
}

impl Failures {
    /// Failures by kind as text; empty if there are none.
    pub fn summary(&self) -> String {
        let kinds = [(self.failed, "failed"), (self.missing_part, "missing part"), (self.wrong_type, "wrong type")];
        let texts = kinds.iter().filter(|k| k.0 > 0).map(|(n, what)| format!("{n} {what}"));
        texts.collect::<Vec<_>>().join(", ")
    }

    /// Runs without success: failed, with a missing part or with a joint of the wrong type. A run with both of the latter
    /// may count twice, at most up to the number of runs.
    pub fn wrong(&self) -> usize {
        (self.failed + self.missing_part + self.wrong_type).min(self.runs)
    }

    pub(crate) fn add(&mut self, other: &Self) {
        self.runs += other.runs;
        self.failed += other.failed;
        self.missing_part += other.missing_part;
        self.wrong_type += other.wrong_type;
    }
}

/// Data of all tables.
#[derive(Clone, Debug)]
pub struct Collected {
    /// Variants, in order.
    pub variants: Vec<VariantInfo>,
    /// Objects, in order.
    pub objects: Vec<ObjectInfo>,
    /// Runs, by variant, object, seed.
    pub records: Vec<Record>,
}

impl Collected {
    /// Combines records with their objects and variants.
    pub fn new(items: &[Item], variants: &[Variant], records: Vec<Record>) -> Self {
        let variant = |v: &Variant| VariantInfo { name: v.name.clone(), description: v.description.clone() };
        let object = |item: &Item| ObjectInfo {
            name: item.name.clone(),
            parts: item.parts,
            stands_for: item.stands_for,
            same_object: item.same_object,
        };
        let objects = items.iter().map(object).collect();
        Self { variants: variants.iter().map(variant).collect(), objects, records }
    }

    /// Runs of a variant on an object.
    pub fn runs<'a>(&'a self, variant: &'a str, object: &'a str) -> impl Iterator<Item = &'a Record> {
        self.records.iter().filter(move |r| r.variant == variant && r.object == object)
    }

    /// A metric over the seeds; runs without it are left out.
    pub fn aggregate(&self, variant: &str, object: &ObjectInfo, metric: Metric) -> Option<Aggregate> {
        let runs = self.runs(variant, &object.name).filter_map(Record::measured);
        aggregate(&runs.filter_map(|m| metric.read(m, object.reported())).collect::<Vec<_>>())
    }

    /// Failures of a variant on an object.
    pub fn failures(&self, variant: &str, object: &str) -> Failures {
        let mut failures = Failures::default();
        for record in self.runs(variant, object) {
            let counts = record.measured().map(|m| m.scores.counts);
            failures.add(&Failures {
                runs: 1,
                failed: usize::from(counts.is_none()),
                missing_part: usize::from(counts.is_some_and(|c| c.missing > 0)),
                wrong_type: usize::from(counts.is_some_and(|c| c.wrong_type > 0)),
            });
        }
        failures
    }

    /// Numbers of parts that the runs of a variant on an object found, by seed; only runs that were not given the number.
    pub fn found_parts(&self, variant: &str, object: &str) -> Vec<usize> {
        let counting = self.runs(variant, object).filter(|r| r.settings.parts.is_none());
        counting.filter_map(|r| Some(r.measured()?.metrics.parts)).collect()
    }

    /// Runs of a variant that found the right number of parts, and all that had to find it and ended.
    pub fn right_counts(&self, variant: &str) -> [usize; 2] {
        let known = self.objects.iter().filter_map(|o| Some((o, o.parts?)));
        known.fold([0; 2], |[right, all], (object, truth)| {
            let found = self.found_parts(variant, &object.name);
            [right + found.iter().filter(|parts| **parts == truth).count(), all + found.len()]
        })
    }

    /// Failures of a variant on all objects.
    pub fn all_failures(&self, variant: &str) -> Failures {
        let mut all = Failures::default();
        self.objects.iter().for_each(|o| all.add(&self.failures(variant, &o.name)));
        all
    }

    /// Facts about the capture of an object, from its first run.
    pub fn facts(&self, object: &str) -> Option<&Facts> {
        self.records.iter().find(|r| r.object == object).map(|r| &r.facts)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{collected, failed, record};

    #[test]
    fn only_runs_that_had_to_count_are_counted() {
        let mut records = vec![record("full", "a", 0, 0.1), record("full", "a", 1, 0.1), record("full", "b", 0, 0.1)];
        assert_eq!(collected(&["full"], &["a", "b"], records.clone()).right_counts("full"), [0, 0]);
        records[1..].iter_mut().for_each(|r| r.settings.parts = None);
        records.push(failed("full", "b", 1, "bang"));
        let all = collected(&["full"], &["a", "b"], records);
        // Every test run finds 2 parts; the second object has 3.
        assert_eq!((all.found_parts("full", "a"), all.right_counts("full")), (vec![2], [1, 2]));
    }

    #[test]
    fn failed_runs_are_counted_and_not_averaged() {
        let mut records =
            vec![record("full", "a", 0, 0.1), record("full", "a", 1, 0.3), failed("full", "a", 2, "bang")];
        if let crate::Outcome::Done(m) = &mut records[1].outcome {
            m.scores.counts.missing = 1;
            m.scores.counts.wrong_type = 2;
        }
        let all = collected(&["full"], &["a"], records);
        let angle = all.aggregate("full", &all.objects[0], Metric::AxisAngle).unwrap();
        assert!((angle.mean - 0.2).abs() < 1e-12 && angle.runs == 2);
        assert!((angle.std.unwrap() - 0.02_f64.sqrt()).abs() < 1e-12);
        let failures = all.failures("full", "a");
        assert_eq!(failures, Failures { runs: 3, failed: 1, missing_part: 1, wrong_type: 1 });
        assert_eq!(failures.summary(), "1 failed, 1 missing part, 1 wrong type");
        assert_eq!(all.all_failures("full"), failures);
        assert_eq!(all.aggregate("full", &all.objects[0], Metric::Lpips), None);
        assert_eq!(all.failures("paper", "a").summary(), "");
    }
}
