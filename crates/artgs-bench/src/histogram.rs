//! Histograms as SVG, in the style of the scatter plots.

use crate::escape::html as escape;
use crate::plot::{COLORS, FONT, MARGIN, SIZE, Scale, line, linear_ticks, text, tick_text};
use std::fmt::Write;

/// Number of bins.
const BINS: usize = 20;
/// Values whose largest is this many times the smallest are binned by their logarithm.
const WIDE: f64 = 20.0;
/// Labels below the axis at most.
const LABELS: usize = 6;

/// Counts of values between edges.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Histogram {
    /// Heading.
    pub title: String,
    /// Label of the x axis, with the unit.
    pub x_label: String,
    /// Edges of the bins in rising order, one more than counts. A value on an edge belongs to the upper bin, the last edge to the last bin.
    pub edges: Vec<f64>,
    /// Values per bin.
    pub counts: Vec<usize>,
}

impl Histogram {
    /// Values in bins of equal width from `low` to `high`; values outside are counted in the first or last bin.
    pub(crate) fn between(title: &str, x_label: &str, values: &[f64], (low, high): (f64, f64)) -> Self {
        let edges = (0..=BINS).map(|i| low + (high - low) * i as f64 / BINS as f64).collect();
        Self::new(title, x_label, values, edges)
    }

    /// Positive values in bins from the smallest to the largest, of equal width or, if they differ much, of equal ratio; none
    /// without values.
    pub(crate) fn of(title: &str, x_label: &str, values: &[f64]) -> Option<Self> {
        let low = values.iter().copied().fold(f64::INFINITY, f64::min);
        let high = values.iter().copied().fold(0.0, f64::max);
        if values.is_empty() {
            return None;
        }
        if low <= 0.0 || high < WIDE * low {
            let high = if high > low { high } else { low + 1.0 };
            return Some(Self::between(title, x_label, values, (low, high)));
        }
        let ratio = (high / low).powf(1.0 / BINS as f64);
        let edges = (0..=BINS).map(|i| low * ratio.powi(i as i32)).collect();
        Some(Self::new(title, x_label, values, edges))
    }

    fn new(title: &str, x_label: &str, values: &[f64], edges: Vec<f64>) -> Self {
        let mut counts = vec![0; edges.len() - 1];
        for value in values {
            let above = edges.partition_point(|edge| edge <= value);
            counts[above.clamp(1, edges.len() - 1) - 1] += 1;
        }
        Self { title: title.into(), x_label: x_label.into(), edges, counts }
    }

    /// The histogram as an `svg` element for an HTML page.
    pub(crate) fn svg(&self) -> String {
        let ((width, height), (left, right, top, bottom)) = (SIZE, MARGIN);
        let ticks = linear_ticks(self.counts.iter().copied().max().unwrap_or(0) as f64);
        let y = Scale { low: 0.0, high: ticks[ticks.len() - 1], from: height - bottom, to: top, log: false };
        let x = Scale { low: 0.0, high: self.counts.len() as f64, from: left, to: width - right, log: false };
        let mut out = format!(
            "<svg viewBox=\"0 0 {width} {height}\" width=\"{width}\" height=\"{height}\" role=\"img\" \
             font-family=\"sans-serif\" font-size=\"{FONT}\" fill=\"#333\">\n"
        );
        let middle = 0.5 * (left + width - right);
        text(&mut out, (middle, 16.0), "middle", "font-size=\"13\" font-weight=\"bold\"", &self.title);
        for tick in ticks {
            line(&mut out, (x.from, y.at(tick)), (x.to, y.at(tick)), "#ddd");
            text(&mut out, (x.from - 6.0, y.at(tick) + 3.5), "end", "", &tick_text(tick));
        }
        for (i, count) in self.counts.iter().enumerate() {
            let (from, to, high) = (x.at(i as f64) + 0.5, x.at(i as f64 + 1.0) - 0.5, y.at(*count as f64));
            let range = format!("{} to {}: {count}", short(self.edges[i]), short(self.edges[i + 1]));
            let _ = writeln!(
                out,
                "<rect x=\"{from:.1}\" y=\"{high:.1}\" width=\"{:.1}\" height=\"{:.1}\" fill=\"{}\" fill-opacity=\"0.8\"><title>{}</title></rect>",
                to - from,
                y.from - high,
                COLORS[0],
                escape(&range)
            );
        }
        for i in (0..self.edges.len()).step_by(self.counts.len().div_ceil(LABELS - 1)) {
            let at = x.at(i as f64);
            line(&mut out, (at, y.from), (at, y.from + 4.0), "#333");
            text(&mut out, (at, y.from + 15.0), "middle", "", &short(self.edges[i]));
        }
        line(&mut out, (x.from, y.from), (x.to, y.from), "#333");
        text(&mut out, (middle, y.from + 31.0), "middle", "", &self.x_label);
        let (cx, cy) = (14.0, 0.5 * (y.from + y.to));
        text(&mut out, (cx, cy), "middle", &format!("transform=\"rotate(-90 {cx} {cy:.1})\""), "captures");
        out.push_str("</svg>\n");
        out
    }
}

/// A number with three significant digits.
pub(crate) fn short(value: f64) -> String {
    let digits = if value == 0.0 { 0 } else { (2 - value.abs().log10().floor() as i32).clamp(0, 6) };
    let text = format!("{value:.*}", digits as usize);
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').into() } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_counted_once() {
        let shares = Histogram::between("t", "x", &[0.0, 0.049, 0.05, 0.99, 1.0, 1.0], (0.0, 1.0));
        assert_eq!((shares.counts[0], shares.counts[1], shares.counts[19]), (2, 1, 3));
        let wide = Histogram::of("t", "x", &[1.0, 10.0, 100.0, 1000.0]).unwrap();
        assert_eq!(wide.counts.iter().sum::<usize>(), 4);
        assert!((wide.edges[10] - 31.6).abs() < 0.1, "{:?}", wide.edges);
        assert_eq!(Histogram::of("t", "x", &[7.0]).unwrap().counts.iter().sum::<usize>(), 1);
        assert_eq!(Histogram::of("t", "x", &[]), None);
    }

    #[test]
    fn numbers_are_short() {
        assert_eq!([0.0, 0.5, 1234.4, 31.62, 0.001234].map(short), ["0", "0.5", "1234", "31.6", "0.00123"]);
    }

    #[test]
    fn a_histogram_is_well_formed() {
        let svg = Histogram::of("a<b", "s", &[1.0, 2.0, 900.0]).unwrap().svg();
        let parsed = roxmltree::Document::parse(&svg).unwrap();
        assert_eq!(parsed.descendants().filter(|n| n.has_tag_name("rect")).count(), BINS);
        assert!(!svg.contains("NaN") && svg.contains("a&lt;b"));
    }
}
