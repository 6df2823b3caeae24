//! The rules of a report as one web page without references to other files.

use crate::report::{CheckReport, RuleFinding, Verdict};
use std::fmt::Write;

const STYLE: &str = "
body { font: 14px/1.45 sans-serif; color: #222; background: #fff; margin: 2rem auto; max-width: 1400px; padding: 0 1.5rem; }
h1 { font-size: 1.5rem; } table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
th, td { padding: .22rem .6rem; border-bottom: 1px solid #eee; text-align: left; vertical-align: top; }
th { background: #f6f6f6; position: sticky; top: 0; } td.number { white-space: nowrap; }
td.subject { min-width: 14em; overflow-wrap: anywhere; } td.checked { min-width: 13em; } td.note, td.remedy { min-width: 9em; }
.passed td.verdict { color: #187a2f; } .warning td.verdict { color: #9a6700; font-weight: bold; }
.failed td.verdict { color: #b3261e; font-weight: bold; } .skipped td { color: #777; }
";

/// Text of HTML.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

const fn word(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Passed => "passed",
        Verdict::Warning => "warning",
        Verdict::Failed => "failed",
        Verdict::Skipped => "skipped",
    }
}

/// Four digits, without trailing zeros.
fn number(value: f64) -> String {
    if value != 0.0 && !(1e-3..1e6).contains(&value.abs()) {
        return format!("{value:.3e}");
    }
    let text = format!("{value:.4}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

fn row(rule: &RuleFinding) -> String {
    let with_unit = |value: Option<f64>| value.map_or(String::new(), |v| format!("{} {}", number(v), rule.unit));
    let side = match rule.limit {
        Some(_) if rule.at_least => "at least ",
        Some(_) => "at most ",
        None => "",
    };
    let remedy = if matches!(rule.verdict, Verdict::Failed | Verdict::Warning) { rule.remedy.as_str() } else { "" };
    let text = |class: &str, text: &str| format!("<td class=\"{class}\">{}</td>", escaped(text.trim()));
    let cells = [
        text("id", &rule.id),
        text("subject", &rule.subject),
        text("verdict", word(rule.verdict)),
        text("checked", &rule.checked),
        text("number", &with_unit(rule.measured)),
        text("number", &format!("{side}{}", with_unit(rule.limit))),
        text("note", &rule.note),
        text("remedy", remedy),
    ];
    format!("<tr class=\"{}\">{}</tr>\n", word(rule.verdict), cells.concat())
}

impl CheckReport {
    /// A page with a line per rule; `title` names the replica.
    pub fn page(&self, title: &str) -> String {
        let rules = self.rules();
        let count = |verdict| rules.iter().filter(|rule| rule.verdict == verdict).count();
        let title = escaped(title);
        let mut out = format!(
            "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\" />\n<title>{title}</title>\n\
             <style>{STYLE}</style>\n</head>\n<body>\n<h1>{title}</h1>\n"
        );
        let counts = [Verdict::Passed, Verdict::Warning, Verdict::Failed, Verdict::Skipped]
            .map(|verdict| format!("{} {}", count(verdict), word(verdict)));
        let _ =
            writeln!(out, "<p>artgs {}: {} rules, {}</p>", env!("CARGO_PKG_VERSION"), rules.len(), counts.join(", "));
        let heads = ["rule", "of", "result", "checked", "measured", "allowed", "found", "what to do"];
        let heads: String = heads.iter().map(|head| format!("<th>{head}</th>")).collect();
        let rows: String = rules.iter().map(row).collect();
        let _ = write!(out, "<table>\n<tr>{heads}</tr>\n{rows}</table>\n</body>\n</html>\n");
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short_and_text_is_escaped() {
        assert_eq!([0.0, 1.0, 0.5, 12.34567, 2e-5].map(number), ["0", "1", "0.5", "12.3457", "2.000e-5"]);
        let rule = RuleFinding {
            note: "<b> & \"x\"".into(),
            measured: Some(0.25),
            unit: "m".into(),
            ..RuleFinding::default()
        };
        let row = row(&rule);
        assert!(row.contains("&lt;b&gt; &amp; &quot;x&quot;") && row.contains("0.25 m"), "{row}");
        assert!(CheckReport::default().page("a < b").contains("<title>a &lt; b</title>"));
    }
}
