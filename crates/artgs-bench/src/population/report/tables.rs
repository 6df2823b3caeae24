//! Tables of a population's report.

use super::calibration::{Calibration, SURE};
use super::changes::{Change, Changes, Pairs};
use super::groups::{FEATURELESS, Group, first_feature};
use super::kinds::{Confusion, KindCount};
use super::statistics::{Middle, Share};
use super::summary::Summary;
use crate::batch::Cause;
use crate::counted::counted;
use crate::histogram::short;
use crate::table::{NOTHING, Table, fill, table};

/// Text of a number that does not exist.
const NONE: &str = "none";
/// Seeds that a cell names.
const SEEDS: usize = 6;

/// The most important numbers, each a row of a name and a text.
pub(super) fn headline(summary: &Summary) -> Table {
    let undecidable = &summary.undecidable;
    let reasons: Vec<String> = undecidable.reasons.iter().map(|(reason, n)| format!("{reason} {n}")).collect();
    let mut rows = vec![
        ("right: number of parts, types, parents".to_string(), share(&summary.right)),
        ("right, and every joint correct".into(), share(&summary.joints_right)),
        ("refused, failed".into(), format!("{} refused, {} failed", summary.refused, summary.failed)),
        ("confidences".into(), confidences(&summary.calibration)),
        ("errors of joints of right objects, median (95th percentile)".into(), errors(summary)),
        ("time and memory, median (95th percentile)".into(), costs(summary)),
        ("most frequent error".into(), worst_kind(summary)),
    ];
    let lossy = [
        ("feature", &summary.features),
        ("category", &summary.categories),
        ("number of parts", &summary.parts),
        ("sensor", &summary.sensors),
    ];
    rows.extend(
        lossy.iter().filter_map(|(what, groups)| Some((format!("{what} that loses most"), worst_group(groups)?))),
    );
    rows.extend(summary.changes.as_ref().map(|changes| ("since the earlier table".into(), changed(&changes.right))));
    let apart = format!(
        "{} ({} refused, {} failed), {} right; {}",
        counted(undecidable.right.of, "object"),
        undecidable.refused,
        undecidable.failed,
        undecidable.right.count,
        if reasons.is_empty() { "no reasons".into() } else { reasons.join(", ") }
    );
    rows.push(("undecidable, counted apart".into(), apart));
    if summary.not_made > 0 {
        rows.push(("could not be made, in no other number".into(), counted(summary.not_made, "object")));
    }
    let covered = summary.numbers.covered.iter().map(share).collect::<Vec<_>>();
    rows.push(("errors within 95 % intervals: axis; position; motion".into(), covered.join("; ")));
    let programs: Vec<String> = summary.programs.iter().map(|(program, n)| format!("{program} ({n})")).collect();
    rows.push(("program (objects)".into(), if programs.is_empty() { NONE.into() } else { programs.join(", ") }));
    let note = format!(
        "{}, {} of them decidable: their views allow only one answer. Shares, errors and confidences are of the decidable ones; time and \
         memory are of all that finished. Refused and failed objects are wrong. Intervals are of 95 % (Wilson). The page Population of the \
         book explains categories, features and reasons.",
        counted(summary.objects, "object"),
        summary.right.of
    );
    fill(table("In short", &note, &["", "result"]), &rows, |(what, text)| vec![what.clone(), text.clone()])
}

fn errors(summary: &Summary) -> String {
    let n = &summary.numbers;
    let (axis, position, motion) = (n.axis_deg, n.position, n.motion);
    format!(
        "axis {} degrees, position {} %, motion {} %",
        middle(axis, 1.0),
        middle(position, 100.0),
        middle(motion, 100.0)
    )
}

fn costs(summary: &Summary) -> String {
    let n = &summary.numbers;
    format!("time {} s, memory {} MiB", middle(n.seconds, 1.0), middle(n.peak_memory_mib, 1.0))
}

/// `0.5 (5.1)`, of values times a scale.
fn middle(middle: Option<Middle>, scale: f64) -> String {
    middle.map_or(NONE.into(), |m| format!("{} ({})", short(scale * m.median), short(scale * m.p95)))
}

/// `8 of 10, 80.0 % (49.0 to 94.3 %)`.
pub(super) fn share(share: &Share) -> String {
    let Share { count, of, .. } = share;
    match share.share.zip(share.interval) {
        Some((value, [low, high])) => {
            format!("{count} of {of}, {:.1} % ({:.1} to {:.1} %)", 100.0 * value, 100.0 * low, 100.0 * high)
        }
        None => NONE.into(),
    }
}

fn percent(share: Option<f64>) -> String {
    share.map_or(NONE.into(), |share| format!("{:.1} %", 100.0 * share))
}

fn interval(share: &Share) -> String {
    share.interval.map_or(NONE.into(), |[low, high]| format!("{:.0} to {:.0} %", 100.0 * low, 100.0 * high))
}

/// The calibration error, and sure joints that are wrong.
pub(super) fn confidences(calibration: &Calibration) -> String {
    let error = calibration.error.map_or(NONE.into(), |error| format!("{error:.3}"));
    let Share { count, of, share, .. } = calibration.sure_and_wrong;
    format!(
        "calibration error {error}; of {} with confidence above {SURE}, {count} wrong ({})",
        counted(of, "joint"),
        percent(share)
    )
}

fn worst_kind(summary: &Summary) -> String {
    match summary.kinds.first().filter(|_| summary.right.rest() > 0) {
        Some(kind) => {
            format!("{}: {} of {}", kind.kind.name(), kind.count, counted(summary.right.rest(), "wrong object"))
        }
        None => NONE.into(),
    }
}

/// The group that loses most; none if no group loses at least half an object. Objects without a feature are no feature.
fn worst_group(groups: &[Group]) -> Option<String> {
    groups
        .iter()
        .filter(|group| group.lost >= 0.5 && group.name != FEATURELESS)
        .max_by(|a, b| a.lost.total_cmp(&b.lost))
        .map(described)
}

/// What a group loses, in words.
pub(super) fn described(group: &Group) -> String {
    let others = group.others.share.map(|share| format!(", others {:.1} %", 100.0 * share)).unwrap_or_default();
    let Share { count, of, share, .. } = group.right;
    format!(
        "{}: {count} of {of} right ({}{others}), {:.1} wrong objects above average",
        group.name,
        percent(share),
        group.lost
    )
}

/// What changed, and whether chance explains it.
pub(super) fn changed(pairs: &Pairs) -> String {
    let Pairs { lost, won, p_value, .. } = pairs;
    format!("{lost} from right to wrong, {won} from wrong to right (p = {})", short(*p_value))
}

/// Errors, time and memory.
pub(super) fn numbers(summary: &Summary) -> Table {
    let note = "Errors of joints with the right type on right objects; time and memory of all finished objects. Percentiles are \
                interpolated linearly between sorted values.";
    let n = &summary.numbers;
    let mut rows = vec![
        ("axis error, degrees".to_string(), n.axis_deg, 1.0),
        ("position error, % of the diagonal of the part".into(), n.position, 100.0),
        ("motion error, % of the motion".into(), n.motion, 100.0),
        ("wall-clock time, s".into(), n.seconds, 1.0),
    ];
    if n.seconds_of_sensor.len() > 1 {
        rows.extend(
            n.seconds_of_sensor
                .iter()
                .map(|(sensor, middle)| (format!("wall-clock time of {sensor}, s"), Some(*middle), 1.0)),
        );
    }
    rows.push(("processor time, s".into(), n.cpu_seconds, 1.0));
    rows.push(("peak memory, MiB".into(), n.peak_memory_mib, 1.0));
    fill(
        table("Errors, time, memory", note, &["", "values", "median", "95th percentile"]),
        &rows,
        |(name, middle, scale)| {
            let cells = match middle {
                Some(Middle { count, median, p95 }) => [count.to_string(), short(scale * median), short(scale * p95)],
                None => ["0".into(), NONE.into(), NONE.into()],
            };
            [vec![name.clone()], cells.to_vec()].concat()
        },
    )
}

/// Kinds of errors.
pub(super) fn kinds(summary: &Summary) -> Table {
    let wrong = summary.right.rest();
    let note = format!(
        "{}, each in the first kind that holds. Below them, objects that count as right with a joint that is not correct: axis to 5 degrees, \
         position to 5 % of the size of the part, motion to 5 % of the true motion or of the size of the part.",
        counted(wrong, "wrong decidable object")
    );
    let head = ["error", "objects", "share of wrong", "most frequent categories", "seeds"];
    fill(table("What goes wrong", &note, &head), &summary.kinds, |KindCount { kind, count, categories, seeds }| {
        let of_wrong = (*kind != super::Kind::Joint && wrong > 0).then(|| *count as f64 / wrong as f64);
        let categories: Vec<String> = categories.iter().map(|(name, n)| format!("{name} {n}")).collect();
        let of_wrong = of_wrong.map_or(NOTHING.into(), |share| format!("{:.0} %", 100.0 * share));
        vec![kind.name().into(), count.to_string(), of_wrong, categories.join(", "), named(seeds)]
    })
}

/// Wrong joint types.
pub(super) fn confusions(confusions: &[Confusion]) -> Table {
    let note = "Found parts that cover a true one and have another type; other errors of their object do not matter.";
    let head = ["true type", "found type", "joints", "largest confidence", "seeds"];
    fill(table("Wrong joint types", note, &head), confusions, |c| {
        let confidence = c.confidence.map_or(NOTHING.into(), |c| format!("{c:.2}"));
        vec![c.truth.clone(), c.found.clone(), c.count.to_string(), confidence, named(&c.seeds)]
    })
}

/// Shares right by a property.
pub(super) fn groups(title: &str, name: &str, note: &str, groups: &[Group]) -> Table {
    let first = first_feature(groups).filter(|group| group.without_first.is_some()).map(|group| group.name.as_str());
    let without = first.map(|first| format!("right without {first}"));
    let mut head =
        vec![name, "objects", "right", "share", "95 % interval", "to others", "lost", "joints correct", "wrong seeds"];
    if let Some(without) = &without {
        head.insert(8, without);
    }
    fill(table(title, note, &head), groups, |g| {
        let mut row = vec![
            g.name.clone(),
            g.right.of.to_string(),
            g.right.count.to_string(),
            percent(g.right.share),
            interval(&g.right),
            g.difference.map_or(NOTHING.into(), |d| format!("{:+.1}", 100.0 * d)),
            format!("{:+.1}", g.lost),
            percent(g.joints_right.share),
            named(&g.wrong),
        ];
        if let Some(share) = &g.without_first {
            row.insert(8, format!("{} of {}", share.count, share.of));
        }
        row
    })
}

/// Bins of confidence.
pub(super) fn calibration(calibration: &Calibration) -> Table {
    let note = format!(
        "{}. {} of decidable objects; {} more without a confidence, not counted. The calibration error is the mean \
         difference between confidence and share of correct joints, over ten bins weighted by their joints. Red bars: the interval of the \
         share does not hold the mean confidence, in either direction.",
        confidences(calibration),
        counted(calibration.joints, "found joint"),
        calibration.without_confidence
    );
    let note = note[..1].to_uppercase() + &note[1..];
    let head = [
        "confidence",
        "joints",
        "correct",
        "share",
        "95 % interval",
        "mean confidence",
        "share less confidence, points",
    ];
    fill(table("Calibration of confidences", &note, &head), &calibration.bins, |bin| {
        let known = |text: String| if bin.correct.of > 0 { text } else { NOTHING.into() };
        let gap = bin.correct.share.zip(bin.confidence).map(|(share, confidence)| share - confidence);
        vec![
            format!("{:.1} to {:.1}", bin.low, bin.high),
            bin.correct.of.to_string(),
            bin.correct.count.to_string(),
            known(percent(bin.correct.share)),
            known(interval(&bin.correct)),
            bin.confidence.map_or(NOTHING.into(), |c| format!("{c:.3}")),
            gap.map_or(NOTHING.into(), |gap| format!("{:+.1}", 100.0 * gap)),
        ]
    })
}

/// What is different from an earlier table; the first one counts.
pub(super) fn changes(changes: &Changes) -> Vec<Table> {
    let head = ["", "right before and now", "right to wrong", "wrong to right", "wrong before and now", "p-value"];
    let note = format!(
        "Objects are compared by seed and sensor: {} in both tables, {} only here, {} only in the earlier one. Not compared, because of another \
         category or number of parts: {}. Undecidable in one of the tables, so that only times are compared: {}. The p-value is that of the \
         exact test of McNemar, two-sided.",
        changes.both, changes.added, changes.removed, changes.other_object, changes.undecidable
    );
    let pairs = [("right", changes.right), ("right, and every joint correct", changes.joints_right)];
    let mut tables = vec![fill(table("Since the earlier table", &note, &head), &pairs, |(name, pairs)| {
        let Pairs { both, lost, won, none, p_value } = pairs;
        let counts = [both, lost, won, none].map(ToString::to_string);
        [vec![(*name).to_string()], counts.to_vec(), vec![short(*p_value)]].concat()
    })];
    for (title, list) in [("From right to wrong", &changes.newly_wrong), ("From wrong to right", &changes.newly_right)]
    {
        if !list.is_empty() {
            tables.push(change_list(title, list));
        }
    }
    tables.push(medians(changes));
    tables
}

fn change_list(title: &str, list: &[Change]) -> Table {
    fill(table(title, "", &["seed", "category", "sensor, features", "before", "now"]), list, |c| {
        let features = [std::slice::from_ref(&c.sensor), &c.features].concat().join(", ");
        vec![c.seed.to_string(), c.category.clone(), features, c.before.clone(), c.after.clone()]
    })
}

fn medians(changes: &Changes) -> Table {
    let pair = |medians: Option<[f64; 2]>| medians.map_or([NONE.into(), NONE.into()], |pair| pair.map(short));
    let rows = [
        ("wall-clock time, s", pair(changes.seconds), changes.time_ratio.map_or(NONE.into(), short)),
        ("peak memory, MiB", pair(changes.peak_memory_mib), "-".into()),
    ];
    let note = format!("Medians; {} finished in both tables.", counted(changes.done_in_both, "object"));
    fill(
        table("Time and memory in both tables", &note, &["", "before", "now", "median of now divided by before"]),
        &rows,
        |(name, [before, now], ratio): &(&str, [String; 2], String)| {
            vec![(*name).into(), before.clone(), now.clone(), ratio.clone()]
        },
    )
}

/// Refusals and failures by cause.
pub(super) fn causes(causes: &[Cause]) -> Table {
    let note = "Of all objects, also undecidable ones and those that could not be made. Reasons without paths, numbers and quoted texts, so that equal causes are one group.";
    let head = ["objects", "cause", "seeds", "first reason"];
    fill(table("Refusals and failures by cause", note, &head), causes, |cause| {
        let more = if cause.count > cause.ids.len() { ", …" } else { "" };
        let seeds = format!("{}{more}", cause.ids.join(", "));
        vec![cause.count.to_string(), cause.cause.clone(), seeds, cause.reason.clone()]
    })
}

/// The first seeds.
fn named(seeds: &[u64]) -> String {
    let shown: Vec<String> = seeds.iter().take(SEEDS).map(ToString::to_string).collect();
    let more = if seeds.len() > SEEDS { ", …" } else { "" };
    if shown.is_empty() { NOTHING.into() } else { format!("{}{more}", shown.join(", ")) }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{not_made, off, refused, right, wrong_type};
    use super::*;

    #[test]
    fn the_headline_has_known_numbers() {
        let few = |seed| super::super::super::Row { features: vec!["thin".into()], ..wrong_type(seed) };
        let rows = [few(1), few(2), right(3), right(4), off(5), refused(6)];
        let summary = Summary::new(&rows, Some(&[right(1), right(3)]));
        let found = headline(&summary);
        let cell = |row: &str| found.rows.iter().find(|r| r.cells[0] == row).map(|r| r.cells[1].clone()).unwrap();
        assert_eq!(cell("right: number of parts, types, parents"), "3 of 6, 50.0 % (18.8 to 81.2 %)");
        assert_eq!(cell("right, and every joint correct"), "2 of 6, 33.3 % (9.7 to 70.0 %)");
        let errors = cell("errors of joints of right objects, median (95th percentile)");
        assert_eq!(errors, "axis 0.5 (5.56) degrees, position 1 (1) %, motion 2 (2) %");
        assert_eq!(cell("time and memory, median (95th percentile)"), "time 10 (10) s, memory 300 (300) MiB");
        assert_eq!(cell("most frequent error"), "joint type wrong: 2 of 3 wrong objects");
        assert_eq!(
            cell("feature that loses most"),
            "thin: 0 of 2 right (0.0 %, others 75.0 %), 1.0 wrong objects above average"
        );
        assert_eq!(cell("since the earlier table"), "1 from right to wrong, 0 from wrong to right (p = 1)");
        let sure = "of 2 joints with confidence above 0.9, 2 wrong (100.0 %)";
        assert!(cell("confidences").ends_with(sure), "{}", cell("confidences"));
    }

    #[test]
    fn one_object_is_singular_and_what_was_not_made_is_apart() {
        let hidden = super::super::super::Row { decidable: false, ..right(2) };
        let summary = Summary::new(&[wrong_type(1), hidden, not_made(3)], None);
        let (head, kinds) = (headline(&summary), kinds(&summary));
        let has = |cells: [&str; 2]| head.rows.iter().any(|row| row.cells == cells);
        assert!(has(["undecidable, counted apart", "1 object (0 refused, 0 failed), 1 right; no reasons"]), "{head:?}");
        assert!(has(["could not be made, in no other number", "1 object"]), "{head:?}");
        assert!(has(["most frequent error", "joint type wrong: 1 of 1 wrong object"]), "{head:?}");
        assert!(head.notes[0].starts_with("3 objects, 1 of them decidable:"), "{head:?}");
        assert!(kinds.notes[0].starts_with("1 wrong decidable object, each"), "{kinds:?}");
        let motion =
            "position to 5 % of the size of the part, motion to 5 % of the true motion or of the size of the part.";
        assert!(kinds.notes[0].ends_with(motion), "{kinds:?}");
    }

    #[test]
    fn the_feature_in_the_head_is_a_feature() {
        let thin = super::super::super::Row { features: vec!["thin".into()], ..right(3) };
        let of = |rows: &[super::super::super::Row]| groups("t", "feature", "", &Summary::new(rows, None).features);
        let table = of(&[wrong_type(1), wrong_type(2), thin]);
        assert_eq!((table.head[8].as_str(), table.rows[0].cells[0].as_str()), ("right without thin", FEATURELESS));
        let table = of(&[wrong_type(1)]);
        assert!(!table.head.iter().any(|name| name.starts_with("right without")), "{table:?}");
    }

    #[test]
    fn nothing_is_called_none() {
        let summary = Summary::new(&[], None);
        let cells = |table: Table| table.rows.into_iter().flat_map(|r| r.cells).collect::<Vec<_>>().join(" ");
        let all = [headline(&summary), numbers(&summary), calibration(&summary.calibration)].map(cells).join(" ");
        assert!(all.contains(NONE) && !all.contains("NaN") && !all.contains("inf"), "{all}");
    }
}
