//! What a run is asked to train on, and what it trains on.

use super::{Cpu, Devices};
use crate::observer::{Event, Observer};
use std::fmt;
use std::str::FromStr;

/// What is asked for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DeviceChoice {
    /// A graphics processor that is not software and trains faster, as long as it works, else the processor.
    #[default]
    Auto,
    /// The processor.
    Cpu,
    /// The graphics processor of this number in the list, or the most capable one, software included.
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
pub struct Chosen {
    /// The device.
    pub devices: Box<dyn Devices>,
    /// Names it, and why it was chosen if the user did not; none where nothing is trained.
    pub description: Option<String>,
}

impl Chosen {
    /// A device, and why it was chosen: empty, or the end of a sentence.
    pub fn new(devices: Box<dyn Devices>, why: &str) -> Self {
        let description = Some(format!("device: {}{why}", devices.name()));
        Self { devices, description }
    }

    /// For a run that trains nothing.
    pub fn none() -> Self {
        Self { devices: Box::new(Cpu), description: None }
    }

    /// Reports which it is.
    pub fn announce(&self, observer: &mut dyn Observer) {
        self.description.iter().for_each(|text| observer.event(Event::note(text)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn choices_read_back_as_they_are_written() {
        for text in ["auto", "cpu", "gpu", "gpu:0", "gpu:12"] {
            assert_eq!(text.parse::<DeviceChoice>().unwrap().to_string(), text);
        }
        for text in ["", "GPU", "gpu:", "gpu:-1", "gpu:one", "cuda", "cpu:0"] {
            assert!(text.parse::<DeviceChoice>().unwrap_err().contains("artgs devices"), "{text}");
        }
    }
}
