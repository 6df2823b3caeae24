//! How a run is shown while it goes: a bar on a terminal, else a line every few seconds, or JSON, or warnings only.
//! No colours anywhere, so there is nothing for `NO_COLOR` to switch off.

use crate::commands::Style;
use crate::failure::harmless;
use artgs::observer::{Event, JsonLines, Observer};
use indicatif::{ProgressBar, ProgressStyle};
use std::io::{self, IsTerminal, Write};
use std::time::{Duration, Instant};

/// Time between lines where there is no terminal.
const PERIOD: Duration = Duration::from_secs(5);

/// The observer that shows a run in the style asked for.
pub(crate) fn renderer(style: Style) -> Box<dyn Observer> {
    match style {
        Style { json: true, .. } => Box::new(JsonLines::new(io::stdout())),
        Style { quiet: true, .. } => Box::new(Lines::new(io::stderr(), None)),
        _ if io::stderr().is_terminal() => Box::new(Bar::default()),
        _ => Box::new(Lines::new(io::stderr(), Some(PERIOD))),
    }
}

/// Speed of a stage since its first report.
#[derive(Clone, Copy, Debug)]
struct Pace {
    since: Instant,
    first_step: usize,
}

impl Pace {
    /// Time left at the mean speed so far; none before there is a speed or an end.
    fn left(&self, now: Instant, step: usize, total: usize) -> Option<Duration> {
        let done = step.checked_sub(self.first_step).filter(|n| *n > 0)?;
        let remaining = total.checked_sub(step)?;
        Some(now.duration_since(self.since).mul_f64(remaining as f64 / done as f64))
    }
}

/// The changing numbers of a stage, as far as it has them.
fn numbers(loss: Option<f64>, psnr: Option<f64>, gaussians: Option<usize>, left: Option<Duration>) -> String {
    let parts = [
        loss.map(|v| format!("loss {v:.4}")),
        psnr.map(|v| format!("PSNR {v:.1} dB")),
        gaussians.map(|n| format!("{n} Gaussians")),
        left.map(|t| format!("{} left", clock(t.as_secs_f64()))),
    ];
    parts.into_iter().flatten().collect::<Vec<_>>().join(", ")
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
}

impl<W: Write> Lines<W> {
    fn new(sink: W, period: Option<Duration>) -> Self {
        Self { sink, period, pace: None, last: None }
    }

    fn line(&mut self, text: &str) {
        let _ = writeln!(self.sink, "{text}");
    }
}

impl<W: Write> Observer for Lines<W> {
    fn event(&mut self, event: Event) {
        if let Event::Warning { message } = &event {
            return self.line(&harmless(&format!("warning: {message}")));
        }
        let Some(period) = self.period else { return };
        match event {
            Event::StageStarted { stage } => {
                (self.pace, self.last) = (None, None);
                self.line(&format!("{stage}: started"));
            }
            Event::Progress { stage, step, total, loss, psnr, gaussians } => {
                let now = Instant::now();
                let pace = *self.pace.get_or_insert(Pace { since: now, first_step: step });
                if self.last.is_some_and(|last| now.duration_since(last) < period) {
                    return;
                }
                self.last = Some(now);
                let numbers = numbers(loss, psnr, gaussians, pace.left(now, step, total));
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
}

impl Bar {
    fn above(&self, text: &str) {
        match &self.bar {
            Some(bar) => bar.suspend(|| writeln!(io::stderr(), "{text}")),
            None => writeln!(io::stderr(), "{text}"),
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
                let template = "{prefix:<11} {bar:30} {pos}/{len} {wide_msg}";
                if let Ok(style) = ProgressStyle::with_template(template) {
                    bar.set_style(style);
                }
                bar.tick();
                self.bar = Some(bar);
            }
            Event::Progress { step, total, loss, psnr, gaussians, .. } => {
                let Some(bar) = &self.bar else { return };
                let now = Instant::now();
                let pace = self.pace.get_or_insert(Pace { since: now, first_step: step });
                bar.set_message(numbers(loss, psnr, gaussians, pace.left(now, step, total)));
                if total > 0 {
                    bar.set_length(total as u64);
                }
                bar.set_position(step as u64);
            }
            Event::StageFinished { stage, seconds, reused } => {
                self.clear();
                self.above(&finished(&stage, seconds, reused));
            }
            Event::Warning { message } => self.above(&harmless(&format!("warning: {message}"))),
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
        lines.event(Event::finished("single", 83.4, false));
        String::from_utf8(lines.sink).unwrap()
    }

    #[test]
    fn lines_are_rationed() {
        let text = lines(Some(Duration::from_secs(3600)));
        assert_eq!(
            text,
            "single: started\nsingle: 0 of 100 loss 0.1250, PSNR 20.0 dB, 42 Gaussians\nwarning: odd\n\
             single: done in 1 min 23 s\n"
        );
        assert_eq!(lines(Some(Duration::ZERO)).lines().count(), 103);
    }

    #[test]
    fn quiet_still_warns() {
        assert_eq!(lines(None), "warning: odd\n");
    }

    #[test]
    fn time_left_follows_the_mean_speed() {
        let since = Instant::now();
        let pace = Pace { since, first_step: 100 };
        let now = since + Duration::from_secs(10);
        assert_eq!(pace.left(now, 150, 400), Some(Duration::from_secs(50)));
        assert_eq!(pace.left(now, 100, 400), None);
        assert_eq!(pace.left(now, 150, 0), None);
    }

    #[test]
    fn times_are_readable() {
        assert_eq!([1.25, 59.4, 60.0, 7384.0].map(clock), ["1.2 s", "59 s", "1 min 00 s", "2 h 03 min"]);
    }
}
