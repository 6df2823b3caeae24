//! `--device`: where training runs, and `artgs devices`: where it could.

use crate::commands::Style;
use crate::failure::Failure;
use crate::gpu;
use crate::output::Report;
use artgs::Config;
use artgs::config::Method;
use artgs::fit::{Cpu, Devices, WithFallback};
use artgs::observer::{Event, Observer};
use serde::Serialize;
use serde_json::json;
use std::fmt;
use std::str::FromStr;

/// What is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum DeviceChoice {
    /// A graphics processor that is not software and trains faster, as long as it works, else the processor.
    Auto,
    Cpu,
    /// The one of this number in the list, or the most capable one, software included.
    Gpu(Option<usize>),
}

impl FromStr for DeviceChoice {
    type Err = &'static str;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        match text {
            "auto" => Ok(Self::Auto),
            "cpu" => Ok(Self::Cpu),
            "gpu" => Ok(Self::Gpu(None)),
            _ => {
                let index = text.strip_prefix("gpu:").and_then(|n| n.parse().ok());
                index.map(|n| Self::Gpu(Some(n))).ok_or("auto, cpu, gpu, or gpu:N as `artgs devices` counts them")
            }
        }
    }
}

impl fmt::Display for DeviceChoice {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Auto => f.write_str("auto"),
            Self::Cpu => f.write_str("cpu"),
            Self::Gpu(None) => f.write_str("gpu"),
            Self::Gpu(Some(index)) => write!(f, "gpu:{index}"),
        }
    }
}

/// What a run trains on.
#[derive(Debug)]
pub(crate) struct Chosen {
    pub(crate) devices: Box<dyn Devices>,
    /// Names it, and why it was chosen if the user did not; none where nothing is trained.
    pub(crate) description: Option<String>,
}

impl Chosen {
    fn new(devices: Box<dyn Devices>, why: &str) -> Self {
        let description = Some(format!("device: {}{why}", devices.name()));
        Self { devices, description }
    }

    /// Reports which it is.
    pub(crate) fn announce(&self, observer: &mut dyn Observer) {
        self.description.iter().for_each(|text| observer.event(Event::note(text)));
    }
}

/// Opens the device for a run with these settings.
pub(crate) fn choose(choice: DeviceChoice, config: &Config) -> Result<Chosen, Failure> {
    if config.method == Method::Registration {
        return Ok(Chosen { devices: Box::new(Cpu), description: None });
    }
    open(choice)
}

/// Opens a device.
pub(crate) fn open(choice: DeviceChoice) -> Result<Chosen, Failure> {
    match choice {
        DeviceChoice::Cpu => Ok(Chosen::new(Box::new(Cpu), "")),
        DeviceChoice::Gpu(index) => Ok(Chosen::new(gpu::open(index).map_err(Failure::bad)?, "")),
        DeviceChoice::Auto => Ok(match gpu::open_if_fast() {
            Ok(gpu) => Chosen::new(Box::new(WithFallback::new(gpu)), ""),
            Err(reason) => Chosen::new(Box::new(Cpu), &format!(", as {reason}")),
        }),
    }
}

/// A graphics processor of the list.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Listed {
    pub(crate) index: usize,
    pub(crate) name: String,
    pub(crate) kind: String,
    pub(crate) interface: String,
    pub(crate) driver: String,
    /// Bytes.
    pub(crate) largest_buffer: u64,
    pub(crate) subgroup: Option<[u32; 2]>,
    pub(crate) timestamps: bool,
    pub(crate) can_train: bool,
    pub(crate) lacks: Option<String>,
}

/// `artgs devices`.
pub(crate) fn list(style: Style) -> Result<(), Failure> {
    report(&gpu::adapters()).show(style.json)
}

fn report(adapters: &[Listed]) -> Report {
    let (instructions, threads) = (Cpu.instructions(), Cpu.threads());
    let mut text = table(adapters);
    if adapters.is_empty() {
        text = format!("{text}{}\n", gpu::NONE_LISTED);
    }
    let json = json!({
        "gpu_support": gpu::SUPPORTED, "adapters": adapters,
        "cpu": { "instructions": instructions, "threads": threads },
    });
    Report { text, json }
}

const HEADER: [&str; 9] =
    ["device", "name", "kind", "interface", "driver", "largest array", "subgroups", "timestamps", "trains"];

fn table(adapters: &[Listed]) -> String {
    let mut rows = vec![HEADER.map(String::from)];
    rows.extend(adapters.iter().map(row));
    let mut cpu: [String; 9] = std::array::from_fn(|_| "-".into());
    (cpu[0], cpu[1], cpu[8]) = ("cpu".into(), Cpu.name(), "yes".into());
    rows.push(cpu);
    let width = |c: usize| rows.iter().map(|r| r[c].chars().count()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..HEADER.len()).map(width).collect();
    let line = |row: &[String; 9]| {
        let cells: Vec<String> = row.iter().zip(&widths).map(|(cell, &w)| format!("{cell:<w$}")).collect();
        format!("{}\n", cells.join("  ").trim_end())
    };
    rows.iter().map(line).collect()
}

fn row(a: &Listed) -> [String; 9] {
    let subgroups = match a.subgroup {
        None => "no".into(),
        Some([least, most]) if least == most => most.to_string(),
        Some([least, most]) => format!("{least} to {most}"),
    };
    let trains = a.lacks.as_ref().map_or("yes".into(), |lacks| format!("no: {lacks}"));
    [
        format!("gpu:{}", a.index),
        a.name.clone(),
        a.kind.clone(),
        a.interface.clone(),
        a.driver.clone(),
        format!("{} MiB", a.largest_buffer >> 20),
        subgroups,
        if a.timestamps { "yes" } else { "no" }.into(),
        trains,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn listed(index: usize) -> Listed {
        Listed {
            index,
            name: "Card".into(),
            kind: "discrete".into(),
            interface: "Vulkan".into(),
            driver: "driver 1.2".into(),
            largest_buffer: 4 << 30,
            subgroup: Some([32, 32]),
            timestamps: true,
            can_train: true,
            lacks: None,
        }
    }

    #[test]
    fn choices_read_back_as_they_are_written() {
        for text in ["auto", "cpu", "gpu", "gpu:0", "gpu:12"] {
            assert_eq!(text.parse::<DeviceChoice>().unwrap().to_string(), text);
        }
        for text in ["", "GPU", "gpu:", "gpu:-1", "gpu:one", "cuda", "cpu:0"] {
            assert!(text.parse::<DeviceChoice>().unwrap_err().contains("artgs devices"), "{text}");
        }
    }

    #[test]
    fn the_table_is_aligned_and_says_what_is_missing() {
        let small = Listed {
            subgroup: Some([8, 32]),
            can_train: false,
            lacks: Some("4 storage buffers per kernel, 12 are needed".into()),
            ..listed(1)
        };
        let Report { text, json } = report(&[listed(0), small]);
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines.len(), 4);
        let place = lines[0].find("trains").unwrap();
        assert_eq!(&lines[1][place..], "yes");
        assert_eq!(&lines[2][place..], "no: 4 storage buffers per kernel, 12 are needed");
        assert!(lines[1].starts_with("gpu:0   Card") && lines[1].contains("4096 MiB") && lines[2].contains("8 to 32"));
        assert!(lines[3].starts_with("cpu ") && lines[3].contains(Cpu.instructions()), "{text}");
        assert_eq!(
            (json["adapters"][1]["can_train"].as_bool(), json["adapters"][0]["index"].as_u64()),
            (Some(false), Some(0))
        );
        assert!(json["cpu"]["threads"].as_u64() > Some(0));
    }

    #[test]
    fn without_adapters_there_is_the_processor_and_a_note() {
        let text = report(&[]).text;
        assert!(
            text.lines().any(|l| l.starts_with("cpu")) && text.ends_with(&format!("{}\n", gpu::NONE_LISTED)),
            "{text}"
        );
    }

    #[test]
    fn what_trains_nothing_opens_nothing() {
        let none = choose(DeviceChoice::Gpu(Some(1000)), &Config::registration()).unwrap();
        assert!(none.description.is_none());
        let error = choose(DeviceChoice::Gpu(Some(1000)), &Config::default()).unwrap_err();
        assert_eq!(error.exit_code(), 2);
        let cpu = choose(DeviceChoice::Cpu, &Config::default()).unwrap();
        assert_eq!(cpu.description, Some(format!("device: {}", Cpu.name())));
    }
}
