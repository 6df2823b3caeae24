use super::{Allowed, Listing, SECTIONS, Setting, all, markdown};
use crate::ablation;
use crate::config::Config;
use std::collections::BTreeSet;
use std::ops::Bound;

/// Settings that together have every optional key and every alternative.
fn presets() -> Vec<Config> {
    let mut full = Config { parts: 3.into(), ..Config::default() };
    (full.surface.voxel, full.canonical.centre_ratio) = (Some(0.01), Some(0.1));
    full.registration.cluster.affinity = Config::paper().canonical.cluster.affinity;
    vec![Config::default(), Config::paper(), Config::registration(), full]
}

fn table_of(config: &Config) -> toml::Table {
    config.to_toml().unwrap().parse().unwrap()
}

/// Dotted paths of all values in a table that are no tables.
fn leaves(table: &toml::Table, path: &str) -> Vec<String> {
    let of = |(key, value): (&String, &toml::Value)| match value {
        toml::Value::Table(inner) => leaves(inner, &format!("{path}{key}.")),
        _ => vec![format!("{path}{key}")],
    };
    table.iter().flat_map(of).collect()
}

/// Paths of a table and of all tables in it, each with a dot at its end.
fn tables(table: &toml::Table, path: &str) -> Vec<String> {
    let inner = table.iter().filter_map(|(key, value)| Some((key, value.as_table()?)));
    let paths = inner.flat_map(|(key, table)| tables(table, &format!("{path}{key}.")));
    std::iter::once(path.to_owned()).chain(paths).collect()
}

/// The message about a line of settings; none if they are accepted.
fn refusal(line: &str) -> Option<String> {
    Config::default().overridden_by(line).err().map(|e| e.to_string())
}

#[test]
fn every_value_has_an_entry_and_every_entry_a_value() {
    let values: BTreeSet<String> = presets().iter().flat_map(|c| leaves(&table_of(c), "")).collect();
    let entries: BTreeSet<String> = all().map(|s| s.path()).collect();
    assert_eq!(entries.len(), all().count(), "a setting has two entries");
    assert_eq!(values.difference(&entries).collect::<Vec<_>>(), Vec::<&String>::new(), "without an entry");
    assert_eq!(entries.difference(&values).collect::<Vec<_>>(), Vec::<&String>::new(), "without a value");
}

#[test]
fn entries_have_the_types_of_their_values() {
    for config in presets() {
        let table = table_of(&config);
        for (s, value) in all().filter_map(|s| Some((s, s.value(&table)?))) {
            let fits = match s.allowed {
                Allowed::Whole { .. } => value.is_integer(),
                Allowed::Number { .. } => value.is_float(),
                Allowed::Switch => value.is_bool(),
                Allowed::Words(words) => value.as_str().is_some_and(|v| words.contains(&v)),
                Allowed::Parts => value.is_integer() || value.is_str(),
            };
            assert!(fits, "{} = {value}", s.path());
        }
    }
}

#[test]
fn presets_and_variants_are_within_the_ranges() {
    let shortened = [0.01, 0.04, 0.1, 0.5, 1.0].map(|factor| Config::paper_scaled(factor).unwrap());
    for config in presets().into_iter().chain(shortened) {
        for (name, _) in ablation::variants() {
            let Ok(variant) = ablation::apply(name, config.clone()) else { continue };
            variant.check().unwrap();
            assert_eq!(Config::default().overridden_by(&variant.to_toml().unwrap()).unwrap(), variant, "{name}");
        }
    }
}

/// Values just outside a range, and just inside.
fn around(allowed: Allowed) -> (Vec<String>, Vec<String>) {
    let step = |v: f64| if v == 0.0 { 1e-6 } else { 1e-4 * v.abs() };
    let number = |v: f64| format!("{v:?}");
    match allowed {
        Allowed::Whole { least, most } => {
            let outside = [least.checked_sub(1), most.checked_add(1)].into_iter().flatten();
            (outside.map(|v| v.to_string()).collect(), vec![least.to_string(), most.to_string()])
        }
        Allowed::Number { low, high } => {
            let (below, least) = match low {
                Bound::Included(v) => (v - step(v), v),
                Bound::Excluded(v) => (v, v + step(v)),
                Bound::Unbounded => panic!("a range without a lower end"),
            };
            let (above, most) = match high {
                Bound::Included(v) => (v + step(v), v),
                Bound::Excluded(v) => (v, v - step(v)),
                Bound::Unbounded => panic!("a range without an upper end"),
            };
            ([below, above].map(number).into(), [least, most].map(number).into())
        }
        _ => Default::default(),
    }
}

#[test]
fn values_out_of_range_are_refused_with_section_key_value_and_range() {
    let is_number = |s: &Setting| matches!(s.allowed, Allowed::Whole { .. } | Allowed::Number { .. });
    for s in all().filter(is_number) {
        let (outside, inside) = around(s.allowed);
        let never = ["nan", "-nan", "inf", "-inf"].map(String::from);
        for value in outside.into_iter().chain(never) {
            let message =
                refusal(&format!("{} = {value}", s.path())).unwrap_or_else(|| panic!("{} = {value}", s.path()));
            let header = if s.section.is_empty() { String::new() } else { format!("[{}] ", s.section) };
            let place = format!("{header}{} = {}: must be ", s.key, value.replace("-nan", "nan"));
            assert!(message.starts_with(&place) && message.contains(&s.allowed.to_string()), "{place}: {message}");
            assert!(message.contains(s.unit), "{message}");
        }
        for value in inside {
            // The largest numbers of some settings exclude each other.
            let message = refusal(&format!("{} = {value}", s.path())).filter(|m| !m.contains("must be less: with"));
            assert_eq!(message, None);
        }
    }
}

#[test]
fn configs_that_are_no_file_are_checked_too() {
    let mut config = Config::default();
    config.articulate.loss.ssim = f32::NAN;
    assert!(config.check().unwrap_err().to_string().contains("[articulate.loss] ssim = nan: must be from 0 to 1"));
    assert_eq!(
        refusal("discover.voxel = 1e-6").unwrap(),
        "[discover] voxel = 1e-6: must be from 0.001 to 0.2 (fraction of the object's diagonal)"
    );
    assert!(refusal("single.steps = 2.5").unwrap().contains("[single] steps = 2.5: must be a whole number from 0"));
    assert!(refusal("single.adam.eps = 1e-60").unwrap().contains("[single.adam] eps = 0.0: must be more than 0"));
    assert_eq!(refusal("surface.resolution = 300"), None);
}

#[test]
fn listed_words_are_all_that_exist() {
    for s in all() {
        let Allowed::Words(words) = s.allowed else { continue };
        for word in words {
            assert_eq!(refusal(&format!("{} = \"{word}\"", s.path())), None);
        }
        let message = refusal(&format!("{} = \"no_such_word\"", s.path())).unwrap();
        // The word, the words that exist, and perhaps the key between back quotes.
        let expected = message.split("expected").nth(1).unwrap();
        let listed = expected.split('`').skip(1).step_by(2).filter(|w| words.contains(w)).count();
        let quoted = expected.split("in `").next().unwrap().matches('`').count() / 2;
        assert_eq!((listed, quoted), (words.len(), words.len()), "{message}");
    }
}

#[test]
fn unknown_keys_are_refused_in_every_section() {
    let mut seen = BTreeSet::new();
    for config in presets() {
        for path in tables(&table_of(&config), "") {
            let error = config.overridden_by(&format!("{path}no_such_key = 1")).unwrap_err().to_string();
            assert!(error.contains("no_such_key"), "{path}: {error}");
            assert!(refusal(&format!("{path}no_such_key = 1")).unwrap().contains("no_such_key"), "{path}");
            seen.insert(path.trim_end_matches('.').to_owned());
        }
    }
    let sections: BTreeSet<String> = SECTIONS.iter().map(|(section, _)| (*section).to_owned()).collect();
    assert_eq!(seen, sections);
    for affinity in ["neighbours = 7", "rbf = 1.0"] {
        for section in ["canonical.cluster", "registration.cluster"] {
            let line = |rest: &str| refusal(&format!("{section}.affinity = {{ {affinity}{rest} }}"));
            assert_eq!(line(""), None);
            assert!(line(", no_such_key = 1").is_some() && line(", rbf = 2.0, neighbours = 3").is_some());
        }
    }
}

#[test]
fn text_has_a_line_per_setting() {
    let shown = Listing::new(&Config::default().to_toml().unwrap()).unwrap().to_string();
    assert_eq!(shown.lines().count(), all().count());
    for line in [
        "discover.voxel = 0.00909091  (0.001 to 0.2, fraction of the object's diagonal)",
        "articulate.loss.ssim = 0.2  (0 to 1, share)",
        "surface.voxel = absent  (0.000001 to 1000000, scene units)",
        "method = \"discover\"  (discover, paper or registration)",
        "single.adam.eps = 1e-15  (more than 0, at most 1, gradient)",
    ] {
        assert!(shown.lines().any(|l| l == line), "{line} is missing:\n{shown}");
    }
}

/// With `ARTGS_UPDATE=1` the page is written instead.
#[test]
fn the_page_of_the_book_is_that_of_the_table() {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/src/settings.md");
    let presets = [Config::default(), Config::paper()].map(|config| config.to_toml().unwrap());
    let page = markdown([&presets[0], &presets[1]]).unwrap();
    if std::env::var_os("ARTGS_UPDATE").is_some() {
        std::fs::write(file, page).unwrap();
    } else {
        let remedy = "docs/src/settings.md is outdated: ARTGS_UPDATE=1 cargo test -p artgs --lib settings writes it";
        assert!(std::fs::read_to_string(file).unwrap() == page, "{remedy}");
    }
}
