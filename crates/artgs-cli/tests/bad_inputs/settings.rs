//! Configuration files. Cases are generated from the table of settings: one below and one above every range, and wrong types.

use crate::case::{Trials, bad, check};
use artgs::settings::{Allowed, Setting, all};
use std::ops::Bound;

const COMMAND: &str = "reconstruct IN/nowhere -o OUT --config IN/c.toml";

/// Runs a configuration with one setting.
fn refused(trials: &mut Trials, setting: &Setting, value: &str, words: &[&str]) {
    let Setting { section, key, .. } = setting;
    let text =
        if section.is_empty() { format!("{key} = {value}\n") } else { format!("[{section}]\n{key} = {value}\n") };
    let name = format!("{} = {value}", setting.path());
    let all: Vec<&str> = ["c.toml", key].into_iter().chain(words.iter().copied()).collect();
    trials.run(&name, "", COMMAND, 2, &all, &|f| f.write("c.toml", &text));
}

/// A number just outside of a range, below and above; none if every number on that side is accepted.
fn outside(allowed: Allowed) -> [Option<String>; 2] {
    let beyond = |end: Bound<f64>, by: f64| match end {
        Bound::Included(v) => Some(format!("{:?}", v + by * (1.0 + v.abs() * 1e-3))),
        Bound::Excluded(v) => Some(format!("{v:?}")),
        Bound::Unbounded => None,
    };
    match allowed {
        Allowed::Whole { least, most } => [least.checked_sub(1), most.checked_add(1)].map(|v| v.map(|v| v.to_string())),
        Allowed::Number { low, high } => [beyond(low, -1.0), beyond(high, 1.0)],
        _ => [None, None],
    }
}

#[test]
fn every_number_below_its_range_is_refused_with_the_range() {
    let mut trials = Trials::default();
    for setting in all() {
        let [below, _] = outside(setting.allowed);
        let Some(below) = below else { continue };
        refused(&mut trials, &setting, &below, &[setting.unit]);
    }
    trials.finish();
}

#[test]
fn every_seventh_number_above_its_range_is_refused() {
    let mut trials = Trials::default();
    for setting in all().step_by(7) {
        let [_, above] = outside(setting.allowed);
        let Some(above) = above else { continue };
        refused(&mut trials, &setting, &above, &["must be"]);
    }
    trials.finish();
}

/// One setting of every section and kind.
fn sample() -> Vec<Setting> {
    let mut sections: Vec<(&str, std::mem::Discriminant<Allowed>)> = Vec::new();
    let new = |s: &Setting| {
        let kind = (s.section, std::mem::discriminant(&s.allowed));
        let is_new = !sections.contains(&kind);
        sections.push(kind);
        is_new
    };
    all().filter(new).collect()
}

#[test]
fn wrong_types_are_refused_in_every_section() {
    let mut trials = Trials::default();
    for (i, setting) in sample().iter().enumerate() {
        let number = matches!(setting.allowed, Allowed::Whole { .. } | Allowed::Number { .. });
        let values: &[&str] = match setting.allowed {
            Allowed::Whole { .. } => &["nan", "inf", "1.5", "\"many\"", "true"],
            Allowed::Number { .. } => &["nan", "-inf", "inf", "\"much\"", "false", "[]"],
            Allowed::Switch => &["1", "\"yes\""],
            Allowed::Words(_) => &["\"no-such-word\"", "3"],
            _ => &["0", "1", "1000", "\"two\"", "\"5..2\"", "2.5"],
        };
        // Each type of value for some settings; all of them for a few.
        let few = if number { &values[i % values.len()..][..1] } else { values };
        few.iter().for_each(|value| refused(&mut trials, setting, value, &[]));
    }
    trials.finish();
}

#[test]
fn files() {
    check(&[
        bad("missing", "", COMMAND, &["c.toml", "No such file"], |_| {}),
        bad("a folder", "", COMMAND, &["c.toml", "directory"], |f| f.write("c.toml/x", "")),
        bad("an unknown section", "", COMMAND, &["c.toml", "articulation", "unknown"], |f| {
            f.write("c.toml", "[articulation]\nsteps = 3\n")
        }),
        bad("an unknown section in a section", "", COMMAND, &["c.toml", "lost", "unknown"], |f| {
            f.write("c.toml", "[single.lost]\nssim = 0.1\n")
        }),
        bad("an unknown key", "", COMMAND, &["c.toml", "step", "unknown"], |f| {
            f.write("c.toml", "[single]\nstep = 3\n")
        }),
        bad("an unknown key outside of sections", "", COMMAND, &["c.toml", "colour", "unknown"], |f| {
            f.write("c.toml", "colour = \"red\"\n")
        }),
        bad("a section that is a number", "", COMMAND, &["c.toml", "single"], |f| f.write("c.toml", "single = 3\n")),
        bad("a section that is a list", "", COMMAND, &["c.toml"], |f| f.write("c.toml", "[[single]]\nsteps = 3\n")),
        bad("a key twice", "", COMMAND, &["c.toml", "duplicate"], |f| f.write("c.toml", "seed = 1\nseed = 2\n")),
        bad("a section twice", "", COMMAND, &["c.toml", "duplicate"], |f| {
            f.write("c.toml", "[single]\nsteps = 3\n[single]\nsteps = 4\n")
        }),
        bad("no value", "", COMMAND, &["c.toml", "line 1"], |f| f.write("c.toml", "seed =\n")),
        bad("no equals sign", "", COMMAND, &["c.toml", "line 1"], |f| f.write("c.toml", "seed\n")),
        bad("an open bracket", "", COMMAND, &["c.toml"], |f| f.write("c.toml", "[single\nsteps = 3\n")),
        bad("an open quotation mark", "", COMMAND, &["c.toml"], |f| f.write("c.toml", "method = \"registr")),
        bad("JSON", "", COMMAND, &["c.toml"], |f| f.write("c.toml", "{\"seed\": 3}")),
        bad("YAML", "", COMMAND, &["c.toml"], |f| f.write("c.toml", "single:\n  steps: 3\n")),
        bad("not text", "", COMMAND, &["c.toml", "UTF-8"], |f| f.write("c.toml", [0xff, 0x80, 0x00, 0xfe])),
        bad("UTF-16", "", COMMAND, &["c.toml", "UTF-16"], |f| {
            f.write(
                "c.toml",
                [vec![0xff, 0xfe], "seed = 3".encode_utf16().flat_map(u16::to_le_bytes).collect()].concat(),
            );
        }),
        bad("a byte order mark before an unknown key", "", COMMAND, &["c.toml", "sed"], |f| {
            f.write("c.toml", "\u{feff}sed = 3\n")
        }),
        bad("a byte order mark is no key", "", COMMAND, &["nowhere"], |f| f.write("c.toml", "\u{feff}seed = 3\n")),
        bad("an empty file is a valid one", "", COMMAND, &["nowhere"], |f| f.write("c.toml", "")),
        bad("a number beyond 64 bits", "", COMMAND, &["c.toml", "seed"], |f| {
            f.write("c.toml", "seed = 99999999999999999999999\n")
        }),
        bad("a negative seed", "", COMMAND, &["c.toml", "seed"], |f| f.write("c.toml", "seed = -1\n")),
        bad("a date", "", COMMAND, &["c.toml", "seed"], |f| f.write("c.toml", "seed = 2020-01-01\n")),
        bad("a hexadecimal float", "", COMMAND, &["c.toml"], |f| f.write("c.toml", "[articulate]\nchamfer = 0x1p3\n")),
        bad("tables without end", "", COMMAND, &["c.toml"], |f| {
            f.write("c.toml", format!("{}\nx = 1\n", "[a".to_owned() + &".a".repeat(20_000) + "]"))
        }),
        bad("lists without end", "", COMMAND, &["c.toml"], |f| {
            f.write("c.toml", format!("seed = {}", "[".repeat(100_000)))
        }),
        bad("many lines", "", COMMAND, &["c.toml"], |f| f.write("c.toml", "x = 1\n".repeat(100_000))),
    ]);
}
