//! Settings of a run from Python values.

use crate::errors::{CallError, whole};
use artgs::config::ConfigError;
use artgs::fit::{Chosen, DeviceChoice};
use artgs::{Config, PartCount};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyFloat, PyInt, PyList, PyString, PyTuple};
use std::path::PathBuf;

/// A file of settings, or the settings themselves.
#[derive(Debug)]
pub(crate) enum Changes {
    File(PathBuf),
    Table(toml::Table),
}

impl<'py> FromPyObject<'_, 'py> for Changes {
    type Error = PyErr;

    fn extract(given: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        match given.cast::<PyDict>() {
            Ok(dict) => Ok(Self::Table(table(&dict.to_owned())?)),
            Err(_) => Ok(Self::File(given.extract()?)),
        }
    }
}

fn table(dict: &Bound<'_, PyDict>) -> PyResult<toml::Table> {
    dict.iter().map(|(key, inner)| Ok((key.extract::<String>()?, value(&inner)?))).collect()
}

fn value(given: &Bound<'_, PyAny>) -> PyResult<toml::Value> {
    // A bool is an int in Python, so it comes first.
    if given.is_instance_of::<PyBool>() {
        Ok(toml::Value::Boolean(given.extract()?))
    } else if given.is_instance_of::<PyInt>() {
        Ok(toml::Value::Integer(given.extract()?))
    } else if given.is_instance_of::<PyFloat>() {
        Ok(toml::Value::Float(given.extract()?))
    } else if given.is_instance_of::<PyString>() {
        Ok(toml::Value::String(given.extract()?))
    } else if let Ok(dict) = given.cast::<PyDict>() {
        Ok(toml::Value::Table(table(dict)?))
    } else if given.is_instance_of::<PyList>() || given.is_instance_of::<PyTuple>() {
        given.try_iter()?.map(|item| value(&item?)).collect::<PyResult<Vec<_>>>().map(toml::Value::Array)
    } else {
        let kind = given.get_type();
        Err(PyTypeError::new_err(format!(
            "a setting is a {kind}; give numbers, texts, bools, lists and dicts of these"
        )))
    }
}

/// A number of parts, the least and the largest, or a text such as `3..8` or `auto`.
#[derive(Debug, FromPyObject)]
pub(crate) enum Parts {
    Number(i64),
    Range(i64, i64),
    Text(String),
}

impl Parts {
    fn count(self) -> Result<PartCount, CallError> {
        let number = |n: i64| whole("parts", Some(n)).map(Option::unwrap_or_default);
        let count = match self {
            Self::Number(parts) => PartCount::Given(number(parts)?),
            Self::Range(least, most) => PartCount::Range { least: number(least)?, most: number(most)? },
            Self::Text(text) => text.parse().map_err(|error| CallError::input(format!("`parts`: {error}")))?,
        };
        count.check().map(|()| count).map_err(|reason| CallError::input(format!("`parts`: {reason}")))
    }
}

/// The settings of a preset with changes.
pub(crate) fn config(
    preset: &str,
    changes: Option<Changes>,
    parts: Option<Parts>,
    seed: Option<i64>,
) -> Result<Config, CallError> {
    let mut config = match preset {
        "default" => Config::default(),
        "paper" => Config::paper(),
        "registration" => Config::registration(),
        other => {
            return Err(CallError::input(format!("`preset` is {other:?}; there are default, paper and registration")));
        }
    };
    if let Some(changes) = changes {
        config = match changes {
            Changes::Table(table) => {
                config.overridden_with(table).map_err(|e| CallError::input(format!("`config`: {e}")))?
            }
            Changes::File(file) => config.overridden_by_file(&file).map_err(CallError::input)?,
        };
    }
    config.parts = parts.map_or(Ok(config.parts), Parts::count)?;
    config.seed = whole("seed", seed)?.unwrap_or(config.seed);
    config.check().and_then(|()| config.check_part_count()).map_err(|error| match error {
        ConfigError::PartsNeeded(_) => CallError::input(format!(
            "`preset={preset:?}` needs `parts`: it cannot find the number of parts; the static part counts"
        )),
        error => CallError::input(error),
    })?;
    Ok(config)
}

/// Opens the device for a run with these settings.
pub(crate) fn device(text: &str, config: &Config) -> Result<Chosen, CallError> {
    let choice: DeviceChoice =
        text.parse().map_err(|known| CallError::input(format!("`device` is {text:?}; give {known}")))?;
    if !config.trains() {
        return Ok(Chosen::none());
    }
    artgs_gpu::open(choice).map_err(CallError::input)
}
