//! Scatter plots as SVG: axes, logarithmic y, error bars, labels. No script, no style sheet, no reference to anything.

use crate::escape::html as escape;
use std::fmt::Write;

/// Size, pixels, and margins around the plotting area: left, right, top, bottom.
pub(crate) const SIZE: (f64, f64) = (460.0, 300.0);
pub(crate) const MARGIN: (f64, f64, f64, f64) = (62.0, 16.0, 34.0, 62.0);
/// Colours of series, repeated when they run out.
pub(crate) const COLORS: [&str; 8] =
    ["#2563eb", "#dc2626", "#059669", "#d97706", "#7c3aed", "#0891b2", "#be185d", "#57534e"];
/// Horizontal distance between series at the same place, and width over which their points there are spread, pixels.
const STEP_ASIDE: f64 = 7.0;
const SPREAD: f64 = 14.0;
/// Widest place of all series together, pixels.
const CROWD: f64 = 44.0;
/// Height of a line of the legend, pixels.
const LEGEND_LINE: f64 = 14.0;
/// Plots with more points have no labels; their names are in tooltips.
const LABELS: usize = 14;
/// Font size of labels and their mean width per character, pixels.
pub(crate) const FONT: f64 = 10.0;
const CHARACTER: f64 = 5.4;

/// A mean with its spread.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Point {
    /// Place on the x axis.
    pub x: f64,
    /// Mean.
    pub y: f64,
    /// Standard deviation.
    pub spread: Option<f64>,
    /// Name of the object.
    pub label: String,
}

/// Points of one colour.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Series {
    /// Name in the legend.
    pub name: String,
    /// Points in any order.
    pub points: Vec<Point>,
}

/// A plot.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Plot {
    /// Heading.
    pub title: String,
    /// Label of the x axis.
    pub x_label: String,
    /// Label of the y axis.
    pub y_label: String,
    /// Ticks of the x axis: place and text.
    pub x_ticks: Vec<(f64, String)>,
    /// Logarithmic y axis.
    pub log_y: bool,
    /// What is shown.
    pub series: Vec<Series>,
}

/// From data to pixels along one axis.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Scale {
    pub(crate) low: f64,
    pub(crate) high: f64,
    pub(crate) from: f64,
    pub(crate) to: f64,
    pub(crate) log: bool,
}

impl Scale {
    pub(crate) fn at(&self, value: f64) -> f64 {
        let f = |v: f64| if self.log { v.max(self.low).log10() } else { v };
        let t = (f(value) - f(self.low)) / (f(self.high) - f(self.low));
        self.from + t.clamp(0.0, 1.0) * (self.to - self.from)
    }
}

/// Nice ticks of a linear axis that cover `[0, high]`, at most seven.
pub(crate) fn linear_ticks(high: f64) -> Vec<f64> {
    let high = if high > 0.0 { high } else { 1.0 };
    let magnitude = 10_f64.powf((high / 5.0).log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0].into_iter().map(|m| m * magnitude).find(|s| high / s <= 5.0).unwrap_or(high);
    (0..=(high / step).ceil() as usize).map(|i| i as f64 * step).collect()
}

/// Ticks of a logarithmic axis: decades around `[low, high]`.
fn decades(low: f64, high: f64) -> Vec<f64> {
    let (first, last) = (low.log10().floor() as i32, high.log10().ceil() as i32);
    (first..=last.max(first + 1)).map(|e| 10_f64.powi(e)).collect()
}

/// Text of a tick.
pub(crate) fn tick_text(value: f64) -> String {
    let text = if value.abs() >= 1.0 || value == 0.0 { format!("{value:.1}") } else { format!("{value:.6}") };
    text.trim_end_matches('0').trim_end_matches('.').to_string()
}

impl Plot {
    fn points(&self) -> impl Iterator<Item = &Point> {
        self.series.iter().flat_map(|s| &s.points)
    }

    /// The plot as an `svg` element for an HTML page.
    pub(crate) fn svg(&self) -> String {
        let (width, height) = SIZE;
        let (left, right, top, bottom) = MARGIN;
        let y_ticks = self.y_ticks();
        let (low, high) = (y_ticks[0], y_ticks[y_ticks.len() - 1]);
        let y = Scale { low, high, from: height - bottom, to: top, log: self.log_y };
        let places = || self.x_ticks.iter().map(|t| t.0);
        let (first, last) = (places().fold(f64::INFINITY, f64::min), places().fold(f64::NEG_INFINITY, f64::max));
        let pad = if last > first { 0.08 * (last - first) } else { 1.0 };
        let x = Scale { low: first - pad, high: last + pad, from: left, to: width - right, log: false };
        let lines = self.legend_places().last().map_or(0, |place| place.1);
        let total = height + LEGEND_LINE * lines as f64;
        let mut out = format!(
            "<svg viewBox=\"0 0 {width} {total}\" width=\"{width}\" height=\"{total}\" role=\"img\" \
             font-family=\"sans-serif\" font-size=\"{FONT}\" fill=\"#333\">\n"
        );
        let middle = 0.5 * (left + width - right);
        text(&mut out, (middle, 16.0), "middle", "font-size=\"13\" font-weight=\"bold\"", &self.title);
        self.axes(&mut out, &x, &y, &y_ticks);
        self.marks(&mut out, &x, &y);
        self.legend(&mut out);
        out.push_str("</svg>\n");
        out
    }

    /// Ticks that cover all means, and the spreads of a linear axis.
    fn y_ticks(&self) -> Vec<f64> {
        let with_spread = |p: &Point| p.y + p.spread.unwrap_or(0.0);
        let high = self.points().map(with_spread).fold(0.0, f64::max);
        if !self.log_y {
            return linear_ticks(high);
        }
        let low = self.points().map(|p| p.y).filter(|v| *v > 0.0).fold(f64::INFINITY, f64::min);
        if low.is_finite() { decades(low, high) } else { decades(0.1, 1.0) }
    }

    fn axes(&self, out: &mut String, x: &Scale, y: &Scale, y_ticks: &[f64]) {
        for tick in y_ticks {
            let at = y.at(*tick);
            line(out, (x.from, at), (x.to, at), "#ddd");
            text(out, (x.from - 6.0, at + 3.5), "end", "", &tick_text(*tick));
        }
        for (place, label) in &self.x_ticks {
            let at = x.at(*place);
            line(out, (at, y.from), (at, y.from + 4.0), "#333");
            text(out, (at, y.from + 15.0), "middle", "", label);
        }
        line(out, (x.from, y.from), (x.to, y.from), "#333");
        line(out, (x.from, y.from), (x.from, y.to), "#333");
        text(out, (0.5 * (x.from + x.to), y.from + 31.0), "middle", "", &self.x_label);
        let (cx, cy) = (14.0, 0.5 * (y.from + y.to));
        text(out, (cx, cy), "middle", &format!("transform=\"rotate(-90 {cx} {cy:.1})\""), &self.y_label);
    }

    fn marks(&self, out: &mut String, x: &Scale, y: &Scale) {
        let at: Vec<Vec<(f64, f64)>> = (0..self.series.len()).map(|s| self.places(s, x, y)).collect();
        let mut taken: Vec<[f64; 4]> =
            at.iter().flatten().map(|(px, py)| [px - 4.0, py - 4.0, px + 4.0, py + 4.0]).collect();
        let labelled = taken.len() <= LABELS;
        for (s, series) in self.series.iter().enumerate() {
            let color = COLORS[s % COLORS.len()];
            for (p, (px, py)) in series.points.iter().zip(at[s].iter().copied()) {
                if let Some(spread) = p.spread {
                    let (high, low) = (y.at(p.y + spread), y.at(p.y - spread));
                    line(out, (px, low), (px, high), color);
                    line(out, (px - 3.0, high), (px + 3.0, high), color);
                    line(out, (px - 3.0, low), (px + 3.0, low), color);
                }
                let tooltip = format!("{}, {}: {}", series.name, p.label, tick_text(p.y));
                let _ = writeln!(
                    out,
                    "<circle cx=\"{px:.1}\" cy=\"{py:.1}\" r=\"3.5\" fill=\"{color}\" fill-opacity=\"0.8\"><title>{}</title></circle>",
                    escape(&tooltip)
                );
                if labelled {
                    label(out, &p.label, (px, py), x.to, &mut taken);
                }
            }
        }
    }

    /// Pixels of the points of a series; series and points at the same place are drawn side by side.
    fn places(&self, s: usize, x: &Scale, y: &Scale) -> Vec<(f64, f64)> {
        let shared = |points: &[Point], p: &Point| points.iter().filter(|o| o.x == p.x).count();
        let crowded = self.series.iter().any(|s| s.points.iter().any(|p| shared(&s.points, p) > 1));
        let wanted = STEP_ASIDE + if crowded { SPREAD } else { 0.0 };
        let step = wanted.min(CROWD / self.series.len() as f64);
        let spread = SPREAD.min(0.7 * step);
        let aside = (s as f64 - 0.5 * (self.series.len() as f64 - 1.0)) * step;
        let points = &self.series[s].points;
        let place = |(i, p): (usize, &Point)| {
            let (before, all) = (shared(&points[..i], p) as f64, shared(points, p) as f64);
            let within = spread * ((before + 0.5) / all - 0.5);
            (x.at(p.x) + aside + within, y.at(p.y))
        };
        points.iter().enumerate().map(place).collect()
    }

    /// Where the names of the series are: x, and the line counted from 0.
    fn legend_places(&self) -> Vec<(f64, usize)> {
        let (mut x, mut line) = (MARGIN.0, 0);
        let place = |series: &Series| {
            let width = 22.0 + CHARACTER * series.name.chars().count() as f64;
            if x > MARGIN.0 && x + width > SIZE.0 {
                (x, line) = (MARGIN.0, line + 1);
            }
            let at = (x, line);
            x += width;
            at
        };
        if self.series.len() > 1 { self.series.iter().map(place).collect() } else { Vec::new() }
    }

    fn legend(&self, out: &mut String) {
        for (s, ((x, line), series)) in self.legend_places().into_iter().zip(&self.series).enumerate() {
            let (y, color) = (SIZE.1 - 10.0 + LEGEND_LINE * line as f64, COLORS[s % COLORS.len()]);
            let _ = writeln!(out, "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"3.5\" fill=\"{color}\" />");
            text(out, (x + 7.0, y + 3.5), "start", "", &series.name);
        }
    }
}

/// Writes a label beside its point if there is space; otherwise the name is only in the tooltip.
fn label(out: &mut String, name: &str, (x, y): (f64, f64), right: f64, taken: &mut Vec<[f64; 4]>) {
    let shown: String =
        if name.chars().count() > 22 { name.chars().take(21).chain(['…']).collect() } else { name.into() };
    let width = CHARACTER * shown.chars().count() as f64;
    for (anchor, from) in [("start", x + 6.0), ("end", x - 6.0 - width)] {
        let place = [from, y - 5.0, from + width, y + 5.0];
        let apart = |t: &[f64; 4]| place[2] < t[0] || t[2] < place[0] || place[3] < t[1] || t[3] < place[1];
        if from > MARGIN.0 && place[2] < right + MARGIN.1 && taken.iter().all(apart) {
            let at = if anchor == "start" { from } else { from + width };
            text(out, (at, y + 3.5), anchor, "fill=\"#666\" font-size=\"9\"", &shown);
            taken.push(place);
            return;
        }
    }
}

pub(crate) fn line(out: &mut String, from: (f64, f64), to: (f64, f64), color: &str) {
    let ((x1, y1), (x2, y2)) = (from, to);
    let _ = writeln!(out, "<line x1=\"{x1:.1}\" y1=\"{y1:.1}\" x2=\"{x2:.1}\" y2=\"{y2:.1}\" stroke=\"{color}\" />");
}

pub(crate) fn text(out: &mut String, (x, y): (f64, f64), anchor: &str, more: &str, content: &str) {
    let content = escape(content);
    let _ = writeln!(out, "<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\" {more}>{content}</text>");
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plot(values: &[(f64, f64)], log_y: bool) -> Plot {
        let point = |(x, y): &(f64, f64)| Point { x: *x, y: *y, spread: Some(0.1), label: "a<b".into() };
        Plot {
            title: "error & parts".into(),
            x_label: "parts".into(),
            y_label: "deg".into(),
            x_ticks: values.iter().map(|v| (v.0, v.0.to_string())).collect(),
            log_y,
            series: vec![
                Series { name: "full".into(), points: values.iter().map(point).collect() },
                Series { name: "paper".into(), points: Vec::new() },
            ],
        }
    }

    #[test]
    fn scales_and_ticks() {
        assert_eq!(decades(0.02, 30.0), [0.01, 0.1, 1.0, 10.0, 100.0]);
        assert_eq!(decades(1.0, 1.0), [1.0, 10.0]);
        assert_eq!(linear_ticks(9.0), [0.0, 2.0, 4.0, 6.0, 8.0, 10.0]);
        assert_eq!([0.001, 0.5, 20.0, 0.0].map(tick_text), ["0.001", "0.5", "20", "0"]);
        let log = Scale { low: 0.01, high: 1.0, from: 0.0, to: 100.0, log: true };
        assert!((log.at(0.1) - 50.0).abs() < 1e-9 && log.at(0.0) == 0.0 && log.at(5.0) == 100.0);
    }

    #[test]
    fn many_series_stay_together_and_their_legend_wraps() {
        let mut many = plot(&[(2.0, 0.5), (2.0, 0.7), (3.0, 0.9)], false);
        let first = many.series[0].clone();
        many.series = (0..9).map(|i| Series { name: format!("variant number {i}"), ..first.clone() }).collect();
        let x = Scale { low: 1.0, high: 4.0, from: MARGIN.0, to: 440.0, log: false };
        for s in 0..9 {
            for (p, (px, _)) in first.points.iter().zip(many.places(s, &x, &x)) {
                assert!((px - x.at(p.x)).abs() < 0.6 * CROWD);
            }
        }
        let legend = many.legend_places();
        assert!(legend.iter().all(|(x, _)| *x < SIZE.0 - 80.0) && legend[8].1 >= 2, "{legend:?}");
    }

    #[test]
    fn a_plot_is_well_formed_and_marks_are_inside() {
        for (values, log) in [(&[(2.0, 0.03), (5.0, 3.0)][..], true), (&[(3.0, 0.0)], true), (&[(3.0, 8.0)], false)] {
            let svg = plot(values, log).svg();
            let parsed = roxmltree::Document::parse(&svg).unwrap();
            let circles: Vec<_> =
                parsed.descendants().filter(|n| n.has_children() && n.has_tag_name("circle")).collect();
            assert_eq!(circles.len(), values.len());
            for circle in circles {
                let at = |name| circle.attribute(name).unwrap().parse::<f64>().unwrap();
                assert!((MARGIN.0..SIZE.0).contains(&at("cx")) && (MARGIN.2..SIZE.1).contains(&at("cy")), "{svg}");
            }
            assert!(svg.contains("a&lt;b") && !svg.contains("NaN") && !svg.contains("inf"));
        }
    }
}
