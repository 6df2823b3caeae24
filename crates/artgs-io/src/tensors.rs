//! Named tensors of 32-bit floats from `safetensors` files, for network weights supplied by users.

use crate::FileError;
use crate::error::read_bytes;
use safetensors::{Dtype, SafeTensors};
use std::collections::BTreeMap;
use std::path::Path;

/// A row-major array.
#[derive(Clone, Debug, PartialEq)]
pub struct Tensor {
    /// Length of every axis, the slowest first.
    pub shape: Vec<usize>,
    /// Values, as many as the product of `shape`.
    pub values: Vec<f32>,
}

/// Reads all tensors of a file by name. Any that is not of type F32 is an error.
pub fn read_safetensors(path: &Path) -> Result<BTreeMap<String, Tensor>, FileError> {
    let bytes = read_bytes(path)?;
    let refuse = |e: safetensors::SafeTensorError| FileError::malformed(path, format!("not a safetensors file: {e}"));
    let file = SafeTensors::deserialize(&bytes).map_err(refuse)?;
    let mut out = BTreeMap::new();
    for (name, view) in file.iter() {
        if view.dtype() != Dtype::F32 {
            let reason = format!("tensor `{name}` is of type {:?}; convert it to F32", view.dtype());
            return Err(FileError::malformed(path, reason));
        }
        let values = view.data().as_chunks().0.iter().map(|b| f32::from_le_bytes(*b)).collect();
        out.insert(name.to_string(), Tensor { shape: view.shape().to_vec(), values });
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The bytes of a file with one tensor of two by three numbers.
    fn file(dtype: &str, numbers: &[f32]) -> Vec<u8> {
        let header = format!(r#"{{"a.weight":{{"dtype":"{dtype}","shape":[2,3],"data_offsets":[0,24]}}}}"#);
        let mut out = (header.len() as u64).to_le_bytes().to_vec();
        out.extend(header.bytes());
        out.extend(numbers.iter().flat_map(|v| v.to_le_bytes()));
        out
    }

    fn read(bytes: &[u8]) -> Result<BTreeMap<String, Tensor>, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("weights.safetensors");
        std::fs::write(&path, bytes).unwrap();
        read_safetensors(&path).map_err(|e| e.to_string())
    }

    #[test]
    fn tensors_come_with_names_shapes_and_values() {
        let numbers = [1.0, -2.5, 3.0, 0.0, 1e-9, 7.0];
        let found = read(&file("F32", &numbers)).unwrap();
        assert_eq!(found["a.weight"], Tensor { shape: vec![2, 3], values: numbers.to_vec() });
    }

    #[test]
    fn broken_files_are_named_with_a_reason() {
        let good = file("F32", &[0.0; 6]);
        for (bytes, words) in [
            (file("I32", &[0.0; 6]), "`a.weight` is of type I32"),
            (good[..good.len() - 4].to_vec(), "not a safetensors file"),
            (b"PK".to_vec(), "not a safetensors file"),
        ] {
            let message = read(&bytes).unwrap_err();
            assert!(message.contains("weights.safetensors") && message.contains(words), "{message}");
        }
    }
}
