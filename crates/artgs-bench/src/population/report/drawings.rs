//! Drawings of a population as SVG: bars of shares, and the reliability of confidences.

use super::calibration::{Bin, Calibration};
use super::statistics::Share;
use crate::escape::html as escape;
use crate::plot::{FONT, MARGIN, SIZE, Scale, line, text};
use std::fmt::Write;

/// Size of a bar, pixels.
const BAR: (f64, f64) = (170.0, 16.0);
/// Colours: a share below the mark by more than its interval, another share, its interval.
const BAD: &str = "#dc2626";
const PLAIN: &str = "#2563eb";
const DARK: &str = "#333";
/// Colour of what a share is compared with.
const MARK: &str = "#d97706";

/// A share as a bar from 0 to 100 % with its interval. A line marks the share of all objects; the bar is red if all of its interval is
/// below. Nothing without a share.
pub(super) fn bar(share: &Share, all: Option<f64>) -> String {
    let Some((value, [low, high])) = share.share.zip(share.interval) else { return String::new() };
    let (width, height) = BAR;
    let x = Scale { low: 0.0, high: 1.0, from: 1.0, to: width - 1.0, log: false };
    let colour = if all.is_some_and(|all| high < all) { BAD } else { PLAIN };
    let mut out = head(width, height);
    let mut rect = |to: f64, fill: &str, opacity: f64| {
        let wide = x.at(to) - x.from;
        let _ = write!(
            out,
            "<rect x=\"{:.1}\" y=\"3\" width=\"{wide:.1}\" height=\"{:.1}\" fill=\"{fill}\" fill-opacity=\"{opacity}\" />",
            x.from,
            height - 6.0
        );
    };
    rect(1.0, "#999", 0.15);
    // A share of 0 is a narrow bar, so that its colour is seen.
    rect(value.max(0.02), colour, 0.55);
    let middle = 0.5 * height;
    line(&mut out, (x.at(low), middle), (x.at(high), middle), DARK);
    for end in [low, high] {
        line(&mut out, (x.at(end), middle - 3.0), (x.at(end), middle + 3.0), DARK);
    }
    if let Some(all) = all {
        line(&mut out, (x.at(all), 0.0), (x.at(all), height), MARK);
    }
    out.push_str("</svg>");
    out
}

fn head(width: f64, height: f64) -> String {
    format!(
        "<svg viewBox=\"0 0 {width} {height}\" width=\"{width}\" height=\"{height}\" role=\"img\" font-family=\"sans-serif\" \
         font-size=\"{FONT}\" fill=\"#333\">\n"
    )
}

/// The share of correct joints by confidence, with intervals and the number of joints. On the diagonal, confidence is the share of
/// correct joints; bins whose interval does not reach their mean confidence are red.
pub(super) fn reliability(calibration: &Calibration) -> String {
    let ((width, height), (left, right, top, bottom)) = (SIZE, MARGIN);
    let y = Scale { low: 0.0, high: 1.0, from: height - bottom, to: top + 10.0, log: false };
    let x = Scale { low: 0.0, high: 1.0, from: left, to: width - right, log: false };
    let mut out = head(width, height);
    let middle = 0.5 * (x.from + x.to);
    text(&mut out, (middle, 16.0), "middle", "font-size=\"13\" font-weight=\"bold\"", "Correct joints by confidence");
    for i in 0..=5 {
        let tick = f64::from(i) / 5.0;
        line(&mut out, (x.from, y.at(tick)), (x.to, y.at(tick)), "#ddd");
        text(&mut out, (x.from - 6.0, y.at(tick) + 3.5), "end", "", &format!("{:.0} %", 100.0 * tick));
        line(&mut out, (x.at(tick), y.from), (x.at(tick), y.from + 4.0), DARK);
        text(&mut out, (x.at(tick), y.from + 15.0), "middle", "", &format!("{tick:.1}"));
    }
    calibration.bins.iter().for_each(|bin| draw_bin(&mut out, bin, &x, &y));
    line(&mut out, (x.from, y.from), (x.to, y.to), MARK);
    line(&mut out, (x.from, y.from), (x.to, y.from), DARK);
    text(&mut out, (middle, y.from + 31.0), "middle", "", "confidence (above: number of joints)");
    let (cx, cy) = (14.0, 0.5 * (y.from + y.to));
    text(&mut out, (cx, cy), "middle", &format!("transform=\"rotate(-90 {cx} {cy:.1})\""), "correct joints");
    out.push_str("</svg>\n");
    out
}

fn draw_bin(out: &mut String, bin: &Bin, x: &Scale, y: &Scale) {
    let (from, to) = (x.at(bin.low) + 1.0, x.at(bin.high) - 1.0);
    let middle = 0.5 * (from + to);
    text(out, (middle, y.to - 5.0), "middle", "fill=\"#666\"", &bin.correct.of.to_string());
    let (Some(share), Some([low, high]), Some(confidence)) = (bin.correct.share, bin.correct.interval, bin.confidence)
    else {
        return;
    };
    let colour = if (low..=high).contains(&confidence) { PLAIN } else { BAD };
    let range = format!("{:.1} to {:.1}: {} of {} correct", bin.low, bin.high, bin.correct.count, bin.correct.of);
    let _ = writeln!(
        out,
        "<rect x=\"{from:.1}\" y=\"{:.1}\" width=\"{:.1}\" height=\"{:.1}\" fill=\"{colour}\" fill-opacity=\"0.45\"><title>{}</title></rect>",
        y.at(share),
        to - from,
        y.from - y.at(share),
        escape(&range)
    );
    line(out, (middle, y.at(low)), (middle, y.at(high)), DARK);
    for end in [low, high] {
        line(out, (middle - 3.0, y.at(end)), (middle + 3.0, y.at(end)), DARK);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn count(svg: &str, name: &str) -> usize {
        assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
        roxmltree::Document::parse(svg).unwrap().descendants().filter(|n| n.has_tag_name(name)).count()
    }

    #[test]
    fn bars_are_well_formed_and_red_if_clearly_below() {
        let bad = bar(&Share::new(1, 20), Some(0.8));
        assert_eq!((count(&bad, "rect"), count(&bad, "line")), (2, 4));
        assert!(bad.contains(BAD) && !bar(&Share::new(7, 10), Some(0.8)).contains(BAD));
        assert_eq!(count(&bar(&Share::new(0, 1), None), "line"), 3);
        assert_eq!(bar(&Share::new(0, 0), None), "");
    }

    #[test]
    fn the_reliability_has_a_bar_for_each_bin_with_joints() {
        let joints = [(Some(0.95), true), (Some(0.94), false), (Some(0.1), false), (None, true)];
        assert_eq!(count(&reliability(&Calibration::new(&joints)), "rect"), 2);
        assert_eq!(count(&reliability(&Calibration::new(&[])), "rect"), 0);
    }
}
