//! `--device`: where training runs, and `artgs devices`: where it could.

use crate::failure::Failure;
use crate::gpu::{self, Listed};
use crate::output::Report;
use crate::style::Style;
use artgs::Config;
use artgs::fit::{Chosen, Cpu, DeviceChoice, Devices};
use serde_json::json;

/// Opens the device for a run with these settings.
pub(crate) fn choose(choice: DeviceChoice, config: &Config) -> Result<Chosen, Failure> {
    if config.trains() { open(choice) } else { Ok(Chosen::none()) }
}

/// Opens a device.
pub(crate) fn open(choice: DeviceChoice) -> Result<Chosen, Failure> {
    gpu::open(choice).map_err(Failure::bad)
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
