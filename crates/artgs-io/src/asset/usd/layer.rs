//! A USD layer as a tree of prims. Only this module uses the `openusd` crate for writing.

use super::repair::repaired;
use openusd::sdf::{
    self, ChildrenKey, FieldKey, PathListOp, Payload, PayloadListOp, Reference, ReferenceListOp, SpecType, Specifier,
    TokenListOp, Value, Variability,
};
use openusd::{usda, usdc};
use std::borrow::Cow;
use std::collections::HashMap;
use std::io::Cursor;

/// A prim with its properties and children.
pub(super) struct Prim {
    name: String,
    specifier: Specifier,
    kind: &'static str,
    fields: Vec<(&'static str, Value)>,
    schemas: Vec<String>,
    properties: Vec<Property>,
    variants: Vec<VariantSet>,
    pub(super) children: Vec<Prim>,
}

/// Contents of a prim of which one is selected. Each option is one payload, or nothing. Only written as text.
pub(super) struct VariantSet {
    pub(super) name: &'static str,
    /// The option that is selected in the file.
    pub(super) selected: &'static str,
    /// Names of the options, each with the path of the layer that it loads.
    pub(super) options: Vec<(&'static str, Option<String>)>,
}

struct Property {
    name: String,
    /// None for a relationship.
    kind: Option<&'static str>,
    fields: Vec<(&'static str, Value)>,
}

/// The root of a file.
pub(super) struct Layer {
    /// Fields such as `upAxis`.
    pub(super) fields: Vec<(&'static str, Value)>,
    pub(super) prims: Vec<Prim>,
}

/// A token as a value.
pub(super) fn token(text: &str) -> Value {
    Value::token(text)
}

/// Three floats as a value.
pub(super) fn float3(v: glam::DVec3) -> Value {
    Value::Vec3f(v.as_vec3().to_array().into())
}

/// A rotation as a value.
pub(super) fn quaternion(q: glam::DQuat) -> Value {
    let q = q.as_quat();
    Value::Quatf([q.w, q.x, q.y, q.z].into())
}

/// A dictionary as a value.
pub(super) fn dictionary<'a>(entries: impl IntoIterator<Item = (&'a str, Value)>) -> Value {
    Value::Dictionary(entries.into_iter().map(|(key, value)| (key.to_owned(), value)).collect())
}

/// The default prims of layers as a value, the strongest first.
pub(super) fn references(layers: &[String]) -> Value {
    let reference = |layer: &String| Reference { asset_path: layer.clone(), ..Reference::default() };
    Value::ReferenceListOp(ReferenceListOp::prepended(layers.iter().map(reference)))
}

/// Triples of floats as a value.
pub(super) fn float3s(v: &[[f32; 3]]) -> Value {
    Value::Vec3fVec(v.iter().map(|v| (*v).into()).collect())
}

impl Prim {
    /// A prim of a type.
    pub(super) fn new(kind: &'static str, name: impl Into<String>) -> Self {
        let (name, specifier) = (name.into(), Specifier::Def);
        let (fields, schemas, properties) = (Vec::new(), Vec::new(), Vec::new());
        Self { name, specifier, kind, fields, schemas, properties, variants: Vec::new(), children: Vec::new() }
    }

    /// An opinion about a prim of another layer.
    pub(super) fn over(name: impl Into<String>) -> Self {
        Self { specifier: Specifier::Over, ..Self::new("", name) }
    }

    /// Applies a schema.
    pub(super) fn api(mut self, schema: impl Into<String>) -> Self {
        self.schemas.push(schema.into());
        self
    }

    /// Sets metadata of the prim.
    pub(super) fn field(mut self, name: &'static str, value: Value) -> Self {
        self.fields.push((name, value));
        self
    }

    fn property(mut self, name: &str, kind: Option<&'static str>, fields: Vec<(&'static str, Value)>) -> Self {
        self.properties.push(Property { name: name.into(), kind, fields });
        self
    }

    /// Where the prim is in its parent.
    pub(super) fn placed(self, translation: glam::DVec3, rotation: glam::DQuat) -> Self {
        self.attr("double3", "xformOp:translate", Value::Vec3d(translation.to_array().into()))
            .attr("quatf", "xformOp:orient", quaternion(rotation))
            .uniform("token[]", "xformOpOrder", Value::token_vec(["xformOp:translate", "xformOp:orient"]))
    }

    /// An attribute that could vary over time.
    pub(super) fn attr(self, kind: &'static str, name: &str, value: Value) -> Self {
        self.property(name, Some(kind), vec![("default", value)])
    }

    /// An attribute that does not vary.
    pub(super) fn uniform(self, kind: &'static str, name: &str, value: Value) -> Self {
        self.property(name, Some(kind), vec![variability(), ("default", value)])
    }

    /// An attribute that no schema knows.
    pub(super) fn custom(self, kind: &'static str, name: &str, value: Value) -> Self {
        self.property(name, Some(kind), vec![("custom", Value::Bool(true)), ("default", value)])
    }

    /// An attribute that no schema knows and that does not vary.
    pub(super) fn custom_uniform(self, kind: &'static str, name: &str, value: Value) -> Self {
        self.property(name, Some(kind), vec![("custom", Value::Bool(true)), variability(), ("default", value)])
    }

    /// An attribute with a value for all faces.
    pub(super) fn constant(self, kind: &'static str, name: &str, value: Value) -> Self {
        self.property(name, Some(kind), vec![("default", value), ("interpolation", token("constant"))])
    }

    /// An attribute with a value per face.
    pub(super) fn per_face(self, kind: &'static str, name: &str, value: Value) -> Self {
        self.property(name, Some(kind), vec![("default", value), ("interpolation", token("uniform"))])
    }

    /// An attribute with a value per vertex.
    pub(super) fn per_vertex(self, kind: &'static str, name: &str, value: Value) -> Self {
        self.property(name, Some(kind), vec![("default", value), ("interpolation", token("vertex"))])
    }

    /// An attribute without a value: the output of a shader.
    pub(super) fn output(self, kind: &'static str, name: &str) -> Self {
        self.property(name, Some(kind), Vec::new())
    }

    /// An attribute fed by another one.
    pub(super) fn connect(self, kind: &'static str, name: &str, source: &str) -> Result<Self, String> {
        let paths = PathListOp::explicit([path(source)?]);
        Ok(self.property(name, Some(kind), vec![("connectionPaths", Value::PathListOp(paths))]))
    }

    /// A relationship to a prim.
    pub(super) fn rel(self, name: &str, target: &str) -> Result<Self, String> {
        self.rels(name, &[target.to_owned()])
    }

    /// Adds a relationship to several prims.
    pub(super) fn rels(self, name: &str, targets: &[String]) -> Result<Self, String> {
        let paths = PathListOp::explicit(targets.iter().map(|target| path(target)).collect::<Result<Vec<_>, _>>()?);
        Ok(self.property(name, None, vec![variability(), ("targetPaths", Value::PathListOp(paths))]))
    }

    /// Adds a child.
    pub(super) fn child(mut self, child: Prim) -> Self {
        self.children.push(child);
        self
    }

    /// Adds a set of variants.
    pub(super) fn variants(mut self, set: VariantSet) -> Self {
        self.variants.push(set);
        self
    }

    /// The fields that say which variants there are and which are selected; none without variants.
    fn variant_fields(&self) -> Vec<(&'static str, Value)> {
        if self.variants.is_empty() {
            return Vec::new();
        }
        let selected: HashMap<String, String> =
            self.variants.iter().map(|set| (set.name.into(), set.selected.into())).collect();
        let names = TokenListOp::prepended(self.variants.iter().map(|set| set.name.into()));
        vec![
            (FieldKey::VariantSelection.as_str(), Value::VariantSelectionMap(selected)),
            (FieldKey::VariantSetNames.as_str(), Value::TokenListOp(names)),
            (ChildrenKey::VariantSetChildren.as_str(), self::names(self.variants.iter().map(|set| set.name))),
        ]
    }

    fn lower(self, data: &mut sdf::Data, parent: &sdf::Path) -> Result<(), String> {
        // `openusd` accepts any text as a name, other libraries do not.
        let word = self.name.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'_');
        if !word || self.name.bytes().next().is_none_or(|b| b.is_ascii_digit()) {
            return Err(inexpressible(&self.name, "names are letters, digits and `_`, and start with no digit"));
        }
        let here = parent.append_path(self.name.as_str()).map_err(|e| inexpressible(&self.name, e))?;
        let mut fields: Vec<(&str, Value)> = vec![(FieldKey::Specifier.as_str(), Value::Specifier(self.specifier))];
        if !self.kind.is_empty() {
            fields.push((FieldKey::TypeName.as_str(), token(self.kind)));
        }
        if !self.schemas.is_empty() {
            let schemas = TokenListOp::prepended(self.schemas.iter().map(|s| s.as_str().into()));
            fields.push((FieldKey::ApiSchemas.as_str(), Value::TokenListOp(schemas)));
        }
        fields.extend(self.variant_fields());
        fields.extend(self.fields);
        fields.push((ChildrenKey::PrimChildren.as_str(), names(self.children.iter().map(|c| c.name.as_str()))));
        fields.push((ChildrenKey::PropertyChildren.as_str(), names(self.properties.iter().map(|p| p.name.as_str()))));
        author(data, here.clone(), SpecType::Prim, fields)?;
        self.variants.into_iter().try_for_each(|set| set.lower(data, &here))?;
        for property in self.properties {
            let at = here.append_property(property.name.as_str()).map_err(|e| inexpressible(&property.name, e))?;
            let kind = property.kind.map(|k| (FieldKey::TypeName.as_str(), token(k)));
            let spec = if kind.is_some() { SpecType::Attribute } else { SpecType::Relationship };
            author(data, at, spec, kind.into_iter().chain(property.fields))?;
        }
        self.children.into_iter().try_for_each(|child| child.lower(data, &here))
    }
}

impl VariantSet {
    fn lower(self, data: &mut sdf::Data, prim: &sdf::Path) -> Result<(), String> {
        let options = names(self.options.iter().map(|(name, _)| *name));
        let set = prim.append_variant_selection(self.name, "");
        author(data, set, SpecType::VariantSet, [(ChildrenKey::VariantChildren.as_str(), options)])?;
        for (name, layer) in self.options {
            let payload = |asset_path| Payload { asset_path, ..Payload::default() };
            let payload = layer.map(|layer| Value::PayloadListOp(PayloadListOp::prepended([payload(layer)])));
            let fields = payload.map(|payload| (FieldKey::Payload.as_str(), payload));
            author(data, prim.append_variant_selection(self.name, name), SpecType::Variant, fields)?;
        }
        Ok(())
    }
}

fn variability() -> (&'static str, Value) {
    (FieldKey::Variability.as_str(), Value::Variability(Variability::Uniform))
}

fn path(text: &str) -> Result<sdf::Path, String> {
    sdf::path(text).map_err(|e| inexpressible(text, e))
}

fn inexpressible(name: &str, error: impl std::fmt::Display) -> String {
    format!("`{name}` cannot be expressed in USD: {error}")
}

fn names<'a>(names: impl Iterator<Item = &'a str>) -> Value {
    Value::token_vec(names)
}

/// Inserts a spec without its empty lists.
fn author<'a>(
    data: &mut sdf::Data,
    path: sdf::Path,
    kind: SpecType,
    fields: impl IntoIterator<Item = (&'a str, Value)>,
) -> Result<(), String> {
    let at = path.to_string();
    let spec = data.create_spec(path, kind);
    for (name, value) in fields {
        if !is_finite(&value) {
            return Err(format!("{at}: a number is not finite; check the asset before exporting it"));
        }
        let no_children = name.ends_with("Children") || name == ChildrenKey::PropertyChildren.as_str();
        if !(no_children && matches!(&value, Value::TokenVec(v) if v.is_empty())) {
            spec.add(name, value);
        }
    }
    Ok(())
}

/// True if a value of one of the written kinds is finite.
fn is_finite(value: &Value) -> bool {
    let all3 = |v: &openusd::gf::Vec3f| v.x.is_finite() && v.y.is_finite() && v.z.is_finite();
    let all4 = |q: &openusd::gf::Quatf| q.w.is_finite() && q.x.is_finite() && q.y.is_finite() && q.z.is_finite();
    match value {
        Value::Float(v) => v.is_finite(),
        Value::FloatVec(v) => v.iter().all(|v| v.is_finite()),
        Value::Double(v) => v.is_finite(),
        Value::Vec2d(v) => v.x.is_finite() && v.y.is_finite(),
        Value::Vec2fVec(v) => v.iter().all(|v| v.x.is_finite() && v.y.is_finite()),
        Value::Vec3d(v) => v.x.is_finite() && v.y.is_finite() && v.z.is_finite(),
        Value::Vec3f(v) => all3(v),
        Value::Vec3fVec(v) => v.iter().all(all3),
        Value::Quatf(v) => all4(v),
        Value::QuatfVec(v) => v.iter().all(all4),
        _ => true,
    }
}

/// A layer ready to be written.
pub(super) struct Lowered(sdf::Data);

impl Layer {
    pub(super) fn lower(self) -> Result<Lowered, String> {
        let mut data = sdf::Data::new();
        let root = sdf::Path::abs_root();
        let children = (ChildrenKey::PrimChildren.as_str(), names(self.prims.iter().map(|p| p.name.as_str())));
        author(&mut data, root.clone(), SpecType::PseudoRoot, self.fields.into_iter().chain([children]))?;
        self.prims.into_iter().try_for_each(|prim| prim.lower(&mut data, &root))?;
        Ok(Lowered(data))
    }
}

impl Lowered {
    /// The layer as text.
    pub(super) fn usda(&self) -> Result<Vec<u8>, String> {
        let text = usda::TextWriter::write_to_string(&self.0).map_err(|e| inexpressible("the layer", e))?;
        Ok(text.split_inclusive('\n').map(corrected).collect::<String>().into_bytes())
    }

    /// The layer as a crate file.
    pub(super) fn usdc(&self) -> Result<Vec<u8>, String> {
        let mut out = Cursor::new(Vec::new());
        usdc::CrateWriter::write(&self.0, &mut out).map_err(|e| inexpressible("the layer", e))?;
        repaired(out.into_inner()).ok_or_else(|| inexpressible("the layer", "the crate file has an unknown form"))
    }
}

/// A line in the form that Pixar's parser needs: a single applied schema in brackets, relationships without `uniform`.
fn corrected(line: &str) -> Cow<'_, str> {
    if let Some((indent, schema)) = line.split_once("prepend apiSchemas = \"") {
        return format!("{indent}prepend apiSchemas = [\"{}]\n", schema.trim_end()).into();
    }
    match line.split_once("uniform rel ") {
        Some((indent, rest)) if indent.trim().is_empty() => format!("{indent}rel {rest}").into(),
        _ => line.into(),
    }
}
