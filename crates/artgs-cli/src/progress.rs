//! How a run is shown while it goes: a bar on a terminal, else a line every few seconds, or JSON, or warnings only.
//! No colours anywhere, so there is nothing for `NO_COLOR` to switch off.

use crate::pace::Pace;
use crate::printable::printable;
use crate::style::Style;
use artgs::observer::{Event, JsonLines, NullObserver, Observer};
use indicatif::{ProgressBar, ProgressStyle};
use std::collections::BTreeSet;
use std::io::{self, IsTerminal, Write};
use std::time::{Duration, Instant};

/// Time between lines where there is no terminal.
const PERIOD: Duration = Duration::from_secs(5);

/// The observer that shows a run in the style asked for.
pub(crate) fn renderer(style: Style) -> Box<dyn Observer> {
    match style {
        Style { silent: true, .. } => Box::new(NullObserver),
        Style { json: true, .. } => Box::new(JsonLines::new(io::stdout())),
        Style { quiet: true, .. } => Box::new(Lines::new(io::stderr(), None)),
        _ if io::stderr().is_terminal() => Box::new(Bar::default()),
        _ => Box::new(Lines::new(io::stderr(), Some(PERIOD))),
    }
}

/// The changing numbers of a stage, as far as it has them.
fn numbers(loss: Option<f64>, psnr: Option<f64>, gaussians: Option<usize>, left: Option<Duration>) -> String {
    let parts = [
        left.map(|t| format!("{} left", clock(t.as_secs_f64()))),
        psnr.map(|v| format!("PSNR {v:.1} dB")),
        gaussians.map(|n| format!("{n} Gaussians")),
        loss.map(|v| format!("loss {v:.4}")),
    ];
    parts.into_iter().flatten().collect::<Vec<_>>().join(", ")
}

/// The warnings of a run that were shown: stages, and the stages of a run that resumes, may repeat them.
#[derive(Default)]
struct Warned(BTreeSet<String>);

impl Warned {
    fn is_new(&mut self, message: &str) -> bool {
        self.0.insert(message.to_string())
    }
}

/// Seconds as people say them.
fn clock(seconds: f64) -> String {
    let whole = seconds.max(0.0).round() as u64;
    match whole {
        0..10 => format!("{seconds:.1} s"),
        10..60 => format!("{whole} s"),
        60..3600 => format!("{} min {:02} s", whole / 60, whole % 60),
        _ => format!("{} h {:02} min", whole / 3600, whole % 3600 / 60),
    }
}

fn finished(stage: &str, seconds: f64, reused: bool) -> String {
    if reused { format!("{stage}: taken from the earlier run") } else { format!("{stage}: done in {}", clock(seconds)) }
}

/// Plain lines; without a period only warnings. Errors of the sink are ignored: progress is not the result.
struct Lines<W: Write> {
    sink: W,
    period: Option<Duration>,
    pace: Option<Pace>,
    last: Option<Instant>,
    warned: Warned,
}

impl<W: Write> Lines<W> {
    fn new(sink: W, period: Option<Duration>) -> Self {
        Self { sink, period, pace: None, last: None, warned: Warned::default() }
    }

    fn line(&mut self, text: &str) {
        let _ = writeln!(self.sink, "{}", printable(text));
    }
}

impl<W: Write> Observer for Lines<W> {
    fn event(&mut self, event: Event) {
        if let Event::Warning { message } = &event {
            if self.warned.is_new(message) {
                self.line(&format!("warning: {message}"));
            }
            return;
        }
        let Some(period) = self.period else { return };
        match event {
            Event::StageStarted { stage } => {
                (self.pace, self.last) = (None, None);
                self.line(&format!("{stage}: started"));
            }
            Event::Progress { stage, step, total, loss, psnr, gaussians } => {
                let now = Instant::now();
                let left = self.pace.get_or_insert_with(|| Pace::new(now, step)).left(now, step, total);
                if self.last.is_some_and(|last| now.duration_since(last) < period) {
                    return;
                }
                self.last = Some(now);
                let numbers = numbers(loss, psnr, gaussians, left);
                let of = if total > 0 { format!(" of {total}") } else { String::new() };
                self.line(format!("{stage}: {step}{of} {numbers}").trim_end());
            }
            Event::StageFinished { stage, seconds, reused } => self.line(&finished(&stage, seconds, reused)),
            Event::Note { message } => self.line(&message),
            Event::Warning { .. } => {}
        }
    }
}

/// One bar per stage on the terminal; finished stages leave a line.
#[derive(Default)]
struct Bar {
    bar: Option<ProgressBar>,
    pace: Option<Pace>,
    warned: Warned,
}

/// A bar whose end is known, and one whose end is not. Name, bar, share and time take 38 columns of at least 80; what does
/// not fit into the rest is cut off. The time shows that a stage works.
const WITH_END: &str = "{prefix:<10} {bar:14} {percent:>3}% {elapsed:>4} {wide_msg}";
const WITHOUT_END: &str = "{prefix:<10} {spinner} {elapsed:>4} {wide_msg}";

/// Time between two drawings of a bar while nothing is reported.
const TICK: Duration = Duration::from_secs(1);

impl Bar {
    fn above(&self, text: &str) {
        match &self.bar {
            Some(bar) => bar.suspend(|| writeln!(io::stderr(), "{}", printable(text))),
            None => writeln!(io::stderr(), "{}", printable(text)),
        }
        // A terminal that cannot be written to is no reason to stop a run.
        .unwrap_or_default();
    }

    fn clear(&mut self) {
        if let Some(bar) = self.bar.take() {
            bar.finish_and_clear();
        }
        self.pace = None;
    }
}

fn set_style(bar: &ProgressBar, template: &str) {
    // Templates are constants; a test parses them.
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style);
    }
}

impl Drop for Bar {
    fn drop(&mut self) {
        self.clear();
    }
}

impl Observer for Bar {
    fn event(&mut self, event: Event) {
        match event {
            Event::StageStarted { stage } => {
                self.clear();
                let bar = ProgressBar::no_length().with_prefix(stage.into_owned());
                set_style(&bar, WITHOUT_END);
                bar.enable_steady_tick(TICK);
                self.bar = Some(bar);
            }
            Event::Progress { step, total, loss, psnr, gaussians, .. } => {
                let Some(bar) = &self.bar else { return };
                let now = Instant::now();
                let left = self.pace.get_or_insert_with(|| Pace::new(now, step)).left(now, step, total);
                bar.set_message(numbers(loss, psnr, gaussians, left));
                if total > 0 && bar.length() != Some(total as u64) {
                    bar.set_length(total as u64);
                    set_style(bar, WITH_END);
                }
                bar.set_position(step as u64);
            }
            Event::StageFinished { stage, seconds, reused } => {
                self.clear();
                self.above(&finished(&stage, seconds, reused));
            }
            Event::Warning { message } => {
                if self.warned.is_new(&message) {
                    self.above(&format!("warning: {message}"));
                }
            }
            Event::Note { message } => self.above(&message),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines(period: Option<Duration>) -> String {
        let mut lines = Lines::new(Vec::new(), period);
        lines.event(Event::started("single"));
        for step in 0..100 {
            lines.event(Event::Progress {
                stage: "single".into(),
                step,
                total: 100,
                loss: Some(0.125),
                psnr: Some(20.04),
                gaussians: Some(42),
            });
        }
        lines.event(Event::warning("odd"));
        lines.event(Event::warning("odd"));
        lines.event(Event::finished("single", 83.4, false));
        String::from_utf8(lines.sink).unwrap()
    }

    #[test]
    fn lines_are_rationed() {
        let text = lines(Some(Duration::from_secs(3600)));
        assert_eq!(
            text,
            "single: started\nsingle: 0 of 100 PSNR 20.0 dB, 42 Gaussians, loss 0.1250\nwarning: odd\n\
             single: done in 1 min 23 s\n"
        );
        assert_eq!(lines(Some(Duration::ZERO)).lines().count(), 103);
    }

    #[test]
    fn quiet_still_warns() {
        assert_eq!(lines(None), "warning: odd\n");
    }

    #[test]
    fn escape_codes_in_messages_are_not_sent_to_the_terminal() {
        let mut lines = Lines::new(Vec::new(), None);
        lines.event(Event::warning("a\u{1b}[31m.png"));
        assert_eq!(String::from_utf8(lines.sink).unwrap(), "warning: a\\u001b[31m.png\n");
    }

    #[test]
    fn bars_fit_80_columns() {
        for template in [WITH_END, WITHOUT_END] {
            let terminal = indicatif::InMemoryTerm::new(4, 80);
            let target = indicatif::ProgressDrawTarget::term_like(Box::new(terminal.clone()));
            let bar = ProgressBar::with_draw_target(Some(7000), target).with_prefix("articulate");
            bar.set_style(ProgressStyle::with_template(template).unwrap());
            bar.set_position(6999);
            let left = Some(Duration::from_secs(3599));
            bar.set_message(numbers(Some(0.1234), Some(28.1), Some(123_456), left));
            bar.force_draw();
            let shown = terminal.contents();
            assert_eq!(shown.lines().count(), 1, "{shown}");
            assert!(shown.contains("59 min 59 s left, PSNR 28.1 dB"), "{shown}");
        }
    }

    #[test]
    fn times_are_readable() {
        assert_eq!([1.25, 59.4, 60.0, 7384.0].map(clock), ["1.2 s", "59 s", "1 min 00 s", "2 h 03 min"]);
    }
}
