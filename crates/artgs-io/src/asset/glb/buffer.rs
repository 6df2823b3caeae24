//! The binary chunk of a GLB with its views and accessors, and the container around both chunks.

use serde_json::{Map, Value, json};

const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;
const UNSIGNED_SHORT: u32 = 5123;
const UNSIGNED_BYTE: u32 = 5121;

/// Content of a view, for graphics cards.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Use {
    /// Attributes of vertices.
    Vertices,
    /// Indices of triangles.
    Indices,
    /// Keys of animations, pictures.
    Other,
}

/// Bytes with their views and accessors.
#[derive(Default)]
pub(super) struct Buffer {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    /// True if a float was not finite.
    broken: bool,
}

impl Buffer {
    /// Index of a new view of `bytes`.
    pub(super) fn view(&mut self, bytes: &[u8], use_: Use) -> usize {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let mut view = json!({"buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len()});
        match use_ {
            Use::Vertices => view["target"] = json!(34962),
            Use::Indices => view["target"] = json!(34963),
            Use::Other => {}
        }
        self.bytes.extend(bytes);
        self.views.push(view);
        self.views.len() - 1
    }

    fn accessor(&mut self, bytes: &[u8], use_: Use, component: u32, count: usize, kind: &str) -> usize {
        let view = self.view(bytes, use_);
        self.accessors.push(json!({"bufferView": view, "componentType": component, "count": count, "type": kind}));
        self.accessors.len() - 1
    }

    /// Index of a new accessor of float vectors; `bounded` states their minimum and maximum.
    pub(super) fn floats<const N: usize>(&mut self, values: &[[f32; N]], use_: Use, bounded: bool) -> usize {
        self.broken |= values.as_flattened().iter().any(|v| !v.is_finite());
        let bytes: Vec<u8> = values.as_flattened().iter().flat_map(|v| v.to_le_bytes()).collect();
        let kind = ["", "SCALAR", "VEC2", "VEC3", "VEC4"][N];
        let index = self.accessor(&bytes, use_, FLOAT, values.len(), kind);
        if bounded {
            let over = |pick: fn(f32, f32) -> f32, start: f32| {
                values.iter().fold([start; N], |m, v| std::array::from_fn(|a| pick(m[a], v[a]))).to_vec()
            };
            self.accessors[index]["min"] = json!(over(f32::min, f32::INFINITY));
            self.accessors[index]["max"] = json!(over(f32::max, f32::NEG_INFINITY));
        }
        index
    }

    /// Index of a new accessor of the corners of triangles.
    pub(super) fn triangles(&mut self, triangles: &[[u32; 3]]) -> usize {
        let bytes: Vec<u8> = triangles.as_flattened().iter().flat_map(|v| v.to_le_bytes()).collect();
        self.accessor(&bytes, Use::Indices, UNSIGNED_INT, 3 * triangles.len(), "SCALAR")
    }

    /// Index of a new accessor of RGBA in [0, 1] with 16 bits each.
    pub(super) fn fine_colors(&mut self, rgba: impl Iterator<Item = [f32; 4]>) -> usize {
        let bytes: Vec<u8> =
            rgba.flatten().flat_map(|v| ((v.clamp(0.0, 1.0) * 65535.0).round() as u16).to_le_bytes()).collect();
        self.colors(&bytes, UNSIGNED_SHORT, bytes.len() / 8)
    }

    /// Index of a new accessor of RGBA in [0, 1] with 8 bits each.
    pub(super) fn coarse_colors(&mut self, rgba: impl Iterator<Item = [f32; 4]>) -> usize {
        let bytes: Vec<u8> = rgba.flatten().map(|v| (v.clamp(0.0, 1.0) * 255.0).round() as u8).collect();
        self.colors(&bytes, UNSIGNED_BYTE, bytes.len() / 4)
    }

    fn colors(&mut self, bytes: &[u8], component: u32, count: usize) -> usize {
        let index = self.accessor(bytes, Use::Vertices, component, count, "VEC4");
        self.accessors[index]["normalized"] = json!(true);
        index
    }

    /// The whole file: `scene` with buffer, views and accessors. Refuses content that JSON or glTF cannot express.
    pub(super) fn into_glb(mut self, mut scene: Map<String, Value>) -> Result<Vec<u8>, String> {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        if !self.bytes.is_empty() {
            scene.insert("buffers".into(), json!([{"byteLength": self.bytes.len()}]));
        }
        scene.insert("bufferViews".into(), self.views.into());
        scene.insert("accessors".into(), self.accessors.into());
        // glTF forbids empty lists.
        scene.retain(|_, value| value.as_array().is_none_or(|a| !a.is_empty()));
        let scene = Value::Object(scene);
        // JSON writes numbers that are not finite as null, and nothing else is null here.
        if self.broken || has_null(&scene) {
            return Err("a number of the asset is not finite; check the asset before exporting it".into());
        }
        let mut json = scene.to_string().into_bytes();
        json.resize(json.len().next_multiple_of(4), b' ');
        let chunks = [(*b"JSON", json), (*b"BIN\0", self.bytes)];
        let chunks = chunks.iter().filter(|(_, bytes)| !bytes.is_empty());
        let total = 12 + chunks.clone().map(|(_, bytes)| 8 + bytes.len()).sum::<usize>();
        let total = u32::try_from(total).map_err(|_| "more than the 4 GiB of a GLB; simplify the meshes")?;
        let mut out = Vec::with_capacity(total as usize);
        out.extend(b"glTF");
        [2, total].iter().for_each(|v| out.extend(v.to_le_bytes()));
        for (kind, bytes) in chunks {
            out.extend((bytes.len() as u32).to_le_bytes());
            out.extend(kind);
            out.extend(bytes);
        }
        Ok(out)
    }
}

fn has_null(value: &Value) -> bool {
    match value {
        Value::Null => true,
        Value::Array(items) => items.iter().any(has_null),
        Value::Object(fields) => fields.values().any(has_null),
        _ => false,
    }
}
