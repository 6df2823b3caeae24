//! Plots of the records.

use crate::collect::{Collected, ObjectInfo};
use crate::metric::{At, Metric, Surface};
use crate::plot::{Plot, Point, Series};

/// Metrics plotted against properties of captures.
const ERRORS: [(Metric, &str); 3] = [
    (Metric::AxisAngle, "axis angle error, deg"),
    (Metric::Cd(Surface::Movable, At::Reported), "CD-m x 1000"),
    (Metric::Cd(Surface::Whole, At::Reported), "CD-w x 1000"),
];

/// A property in which captures differ: a number, or else a name.
type Trait = fn(&Collected, &ObjectInfo) -> Option<String>;

fn parts(_: &Collected, object: &ObjectInfo) -> Option<String> {
    object.parts.map(|k| k.to_string())
}

fn views(all: &Collected, object: &ObjectInfo) -> Option<String> {
    all.facts(&object.name).filter(|f| f.views > 0).map(|f| f.views.to_string())
}

fn size(all: &Collected, object: &ObjectInfo) -> Option<String> {
    all.facts(&object.name).filter(|f| f.size > 0).map(|f| f.size.to_string())
}

fn noise(all: &Collected, object: &ObjectInfo) -> Option<String> {
    all.facts(&object.name).and_then(|f| f.noise.clone())
}

/// Error and time against the number of parts always; error against noise, views and image size where these vary.
pub(crate) fn plots(all: &Collected) -> Vec<Plot> {
    let mut plots = Vec::new();
    for (metric, label) in ERRORS {
        plots.extend(plot(all, metric, label, parts, "number of parts, the static one included", 1));
    }
    plots.extend(plot(all, Metric::Minutes, "minutes", parts, "number of parts, the static one included", 1));
    let against: [(Trait, &str); 3] =
        [(noise, "noise of the capture"), (views, "training views per state"), (size, "image width, pixels")];
    for (of, x_label) in against {
        for (metric, label) in ERRORS {
            plots.extend(plot(all, metric, label, of, x_label, 2));
        }
    }
    plots
}

/// A plot of a metric, if there are at least `least` different values on its x axis.
fn plot(all: &Collected, metric: Metric, y_label: &str, of: Trait, x_label: &str, least: usize) -> Option<Plot> {
    let shown = |o: &ObjectInfo| all.variants.iter().any(|v| all.aggregate(&v.name, o, metric).is_some());
    let values: Vec<(&ObjectInfo, String)> =
        all.objects.iter().filter(|o| shown(o)).filter_map(|o| Some((o, of(all, o)?))).collect();
    let x_ticks = places(values.iter().map(|v| v.1.as_str()));
    let place = |text: &str| x_ticks.iter().find(|t| t.1 == text).map_or(0.0, |t| t.0);
    let series = |variant: &crate::collect::VariantInfo| {
        let point = |(object, x): &(&ObjectInfo, String)| {
            let a = all.aggregate(&variant.name, object, metric)?;
            Some(Point { x: place(x), y: a.mean, spread: a.std, label: object.name.clone() })
        };
        Series { name: variant.name.clone(), points: values.iter().filter_map(point).collect() }
    };
    let series: Vec<Series> = all.variants.iter().map(series).filter(|s| !s.points.is_empty()).collect();
    if x_ticks.len() < least || series.is_empty() {
        return None;
    }
    let what = x_label.split(',').next().unwrap_or(x_label);
    Some(Plot {
        title: format!("{} against {what}", metric.label()),
        x_label: x_label.into(),
        y_label: y_label.into(),
        x_ticks,
        log_y: metric != Metric::Minutes,
        series,
    })
}

/// Places on the x axis of distinct values: the numbers if all are, else one after the other.
fn places<'a>(values: impl Iterator<Item = &'a str>) -> Vec<(f64, String)> {
    let mut distinct: Vec<&str> = values.collect();
    distinct.sort_unstable();
    distinct.dedup();
    let numbers: Option<Vec<f64>> = distinct.iter().map(|v| v.parse().ok().filter(|n: &f64| n.is_finite())).collect();
    let at = numbers.unwrap_or_else(|| (0..distinct.len()).map(|i| i as f64).collect());
    let mut places: Vec<(f64, String)> = at.into_iter().zip(distinct.into_iter().map(String::from)).collect();
    places.sort_by(|a, b| a.0.total_cmp(&b.0));
    places
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{collected, record};

    #[test]
    fn places_are_numbers_or_an_order() {
        assert_eq!(places(["10", "9", "10"].into_iter()), [(9.0, "9".into()), (10.0, "10".into())]);
        assert_eq!(places(["low", "high"].into_iter()), [(0.0, "high".into()), (1.0, "low".into())]);
    }

    #[test]
    fn plots_against_what_does_not_vary_are_left_out() {
        let mut records = vec![record("full", "a", 0, 0.1), record("full", "b", 0, 0.3)];
        let titles = |records: &[crate::Record]| -> Vec<String> {
            plots(&collected(&["full"], &["a", "b"], records.to_vec())).into_iter().map(|p| p.title).collect()
        };
        let few = titles(&records);
        assert_eq!(few.len(), 4, "{few:?}");
        records[1].facts.views = 99;
        records[0].facts.noise = Some("0".into());
        records[1].facts.noise = Some("0.01".into());
        let more = titles(&records);
        assert_eq!(more.len(), 10, "{more:?}");
        assert!(more.contains(&"Axis Ang against training views per state".to_string()), "{more:?}");
    }
}
