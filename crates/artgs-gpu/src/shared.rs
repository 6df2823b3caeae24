//! What the kernels share with Rust: constants, and structs in buffers. Both are written in Rust once; the kernels get them
//! as WGSL source.

use crate::constants;
use crate::joints::Joint;
use crate::published::chamfer::Grid;
use crate::published::membership::{Layer, Level};
use crate::scene::{Digit, Flat};
use crate::step::{Outcome, PartTerms, Step};

/// A type that exists in WGSL too.
pub(crate) trait Wgsl {
    /// Its name in WGSL.
    const NAME: &'static str;
}

/// A value that can be written as a WGSL constant.
pub(crate) trait Constant: Wgsl {
    /// It in WGSL.
    fn literal(&self) -> String;
}

macro_rules! wgsl_types {
    ($($rust:ty = $wgsl:literal,)*) => { $(impl Wgsl for $rust { const NAME: &'static str = $wgsl; })* };
}

wgsl_types! {
    u32 = "u32",
    f32 = "f32",
    [u32; 2] = "vec2u",
    [u32; 3] = "vec3u",
    [u32; 4] = "vec4u",
    [f32; 2] = "vec2f",
    [f32; 3] = "vec3f",
    [f32; 4] = "vec4f",
    [[f32; 4]; 2] = "array<vec4f, 2>",
    [f32; 11] = "array<f32, 11>",
}

impl Constant for u32 {
    fn literal(&self) -> String {
        format!("{self}u")
    }
}

impl Constant for f32 {
    /// The shortest decimal that reads back as the same number.
    fn literal(&self) -> String {
        format!("{self:?}f")
    }
}

impl Constant for [f32; 11] {
    fn literal(&self) -> String {
        format!("{}({})", Self::NAME, self.map(|v| v.literal()).join(", "))
    }
}

/// A struct in a buffer that both sides read. The order of its fields must be such that WGSL needs no padding that
/// `repr(C)` does not have; a test compares the layouts.
pub(crate) trait Shared: bytemuck::Pod {
    /// Name of the struct in WGSL.
    const NAME: &'static str;
    /// Its fields in order.
    const FIELDS: &'static [Field];

    /// Its definition in WGSL.
    fn wgsl() -> String {
        let fields: String = Self::FIELDS.iter().map(|f| format!("    {}: {},\n", f.name, f.wgsl)).collect();
        format!("struct {} {{\n{fields}}}\n", Self::NAME)
    }
}

/// A field of a [`Shared`] struct.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Field {
    pub(crate) name: &'static str,
    /// Its type in WGSL.
    pub(crate) wgsl: &'static str,
    /// Bytes from the beginning of the struct.
    #[cfg(test)]
    pub(crate) offset: usize,
    /// Bytes of the field.
    #[cfg(test)]
    pub(crate) size: usize,
}

/// Defines a `repr(C)` struct that is also available to the kernels, see [`Shared`].
macro_rules! shared_struct {
    ($(#[$attribute:meta])* $visible:vis struct $name:ident {
        $($(#[$field_attribute:meta])* $field_visible:vis $field:ident: $kind:ty,)*
    }) => {
        $(#[$attribute])*
        #[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
        #[repr(C)]
        $visible struct $name { $($(#[$field_attribute])* $field_visible $field: $kind,)* }

        impl $crate::shared::Shared for $name {
            const NAME: &'static str = stringify!($name);
            const FIELDS: &'static [$crate::shared::Field] = &[$($crate::shared::Field {
                name: stringify!($field),
                wgsl: <$kind as $crate::shared::Wgsl>::NAME,
                #[cfg(test)]
                offset: std::mem::offset_of!($name, $field),
                #[cfg(test)]
                size: size_of::<$kind>(),
            },)*];
        }
    };
}
pub(crate) use shared_struct;

/// Defines constants, and `wgsl` that writes them all as WGSL.
macro_rules! shared_constants {
    ($($(#[$attribute:meta])* $name:ident: $kind:ty = $value:expr;)*) => {
        $($(#[$attribute])* pub(crate) const $name: $kind = $value;)*

        /// All of them as WGSL.
        pub(crate) fn wgsl() -> String {
            [$($crate::shared::definition(stringify!($name), &$name)),*].concat()
        }
    };
}

pub(crate) use shared_constants;

/// A constant in WGSL.
pub(crate) fn definition<T: Constant>(name: &str, value: &T) -> String {
    format!("const {name}: {} = {};\n", T::NAME, value.literal())
}

/// All shared constants and structs as WGSL; every kernel begins with them. `bucket` is the number of Gaussians of a tile
/// that one workgroup of the backward pass handles.
pub(crate) fn wgsl(bucket: u32) -> String {
    [
        constants::wgsl(),
        definition("BUCKET", &bucket),
        definition("WINDOW", &artgs::low_level::kernel_constants::ssim_window()),
        Step::wgsl(),
        Flat::wgsl(),
        Outcome::wgsl(),
        PartTerms::wgsl(),
        Joint::wgsl(),
        Layer::wgsl(),
        Level::wgsl(),
        Grid::wgsl(),
        Digit::wgsl(),
    ]
    .concat()
}
