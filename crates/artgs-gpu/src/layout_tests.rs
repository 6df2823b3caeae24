//! The source of every kernel, parsed by naga: structs have the layout of the Rust types, bindings the declared uses.

use crate::joints::Joint;
use crate::kernel::Use;
use crate::kernels::{Kernels, PixelTransfer};
use crate::published::chamfer::Grid;
use crate::published::membership::{Layer, Level};
use crate::scene::{Digit, Flat};
use crate::shared::{Shared, wgsl};
use crate::step::{Outcome, PartTerms, Step};
use naga::{AddressSpace, Module, StorageAccess, TypeInner};

fn parse(name: &str, source: &str) -> Module {
    naga::front::wgsl::parse_str(source).unwrap_or_else(|e| panic!("{name}: {}", e.emit_to_string(source)))
}

/// Panics where the struct of the module differs from the Rust type, or is in a uniform that Rust places otherwise.
fn assert_layout<T: Shared>(module: &Module) {
    let name = T::NAME;
    let found = module.types.iter().find(|(_, t)| t.name.as_deref() == Some(name));
    let Some((_, naga::Type { inner: TypeInner::Struct { members, span }, .. })) = found else {
        panic!("no struct {name}");
    };
    assert_eq!(*span as usize, size_of::<T>(), "size of {name}");
    let names: Vec<&str> = members.iter().filter_map(|m| m.name.as_deref()).collect();
    assert_eq!(names, T::FIELDS.iter().map(|f| f.name).collect::<Vec<_>>(), "fields of {name}");
    for (member, field) in members.iter().zip(T::FIELDS) {
        assert_eq!(member.offset as usize, field.offset, "offset of {name}.{}", field.name);
        let size = module.types[member.ty].inner.size(module.to_ctx()) as usize;
        assert_eq!(size, field.size, "size of {name}.{}", field.name);
    }
}

#[test]
fn structs_of_kernels_have_the_layout_of_the_rust_types() {
    let module = parse("shared", &wgsl(32));
    assert_layout::<Step>(&module);
    assert_layout::<Outcome>(&module);
    assert_layout::<PartTerms>(&module);
    assert_layout::<Flat>(&module);
    assert_layout::<Digit>(&module);
    assert_layout::<Joint>(&module);
    assert_layout::<Layer>(&module);
    assert_layout::<Level>(&module);
    assert_layout::<Grid>(&module);
}

fn use_of(space: AddressSpace, type_name: Option<&str>) -> Option<Use> {
    match space {
        AddressSpace::Uniform if type_name == Some(Step::NAME) => Some(Use::Step),
        AddressSpace::Uniform => Some(Use::Constant),
        AddressSpace::Storage { access } if access.contains(StorageAccess::STORE) => Some(Use::Write),
        AddressSpace::Storage { .. } => Some(Use::Read),
        _ => None,
    }
}

#[test]
fn every_kernel_is_valid_and_has_the_bindings_it_declares() {
    for transfer in [PixelTransfer::Memory, PixelTransfer::Subgroup(32), PixelTransfer::Subgroup(64)] {
        Kernels::each(transfer, |name, source, uses| {
            let module = parse(name, &source);
            let mut validator =
                naga::valid::Validator::new(naga::valid::ValidationFlags::all(), naga::valid::Capabilities::all());
            validator.validate(&module).unwrap_or_else(|e| panic!("{name}: {}", e.emit_to_string(&source)));
            assert!(module.entry_points.iter().any(|e| e.name == name), "{name} is an entry point");
            for (_, variable) in module.global_variables.iter() {
                let type_name = module.types[variable.ty].name.as_deref();
                let Some(found) = use_of(variable.space, type_name) else { continue };
                let at = variable.binding.map_or(usize::MAX, |b| b.binding as usize);
                // Kernels of one file may leave out its last bindings.
                if let Some(declared) = uses.get(at) {
                    assert_eq!(found, *declared, "{name}: binding {at}");
                }
            }
        });
    }
}
