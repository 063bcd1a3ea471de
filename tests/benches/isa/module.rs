//! A compute module in SPIR-V, and the resources that its pipeline's layout needs.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use ash::vk::DescriptorType;
use frugal_tests::gpu;
use rspirv::binary::parse_words;
use rspirv::dr::{Instruction, Loader, Module, Operand};
use rspirv::spirv::{Decoration, ExecutionModel, Op, StorageClass};

/// A module with one compute entry point.
pub(crate) struct ComputeModule {
    pub(crate) entry_point: String,
    pub(crate) words: Vec<u32>,
    /// By descriptor set and binding.
    pub(crate) bindings: BTreeMap<(u32, u32), DescriptorType>,
}

impl ComputeModule {
    /// Reads a file. `None` if it holds another kind of shader.
    pub(crate) fn read(file: &Path) -> Option<Self> {
        let bytes = fs::read(file).unwrap_or_else(|error| panic!("{file:?}: {error}"));
        let words = gpu::words(&bytes);
        let mut loader = Loader::new();
        parse_words(&words, &mut loader).unwrap_or_else(|error| panic!("{file:?}: {error}"));
        let module = loader.module();
        let entry_point =
            module.entry_points.iter().find_map(|entry| match &entry.operands[..] {
                [
                    Operand::ExecutionModel(ExecutionModel::GLCompute),
                    _,
                    Operand::LiteralString(name),
                    ..,
                ] => Some(name.clone()),
                _ => None,
            })?;
        let bindings = bindings(&module);
        Some(Self { entry_point, words, bindings })
    }
}

fn bindings(module: &Module) -> BTreeMap<(u32, u32), DescriptorType> {
    let by_id: BTreeMap<u32, &Instruction> = module
        .types_global_values
        .iter()
        .filter_map(|instruction| Some((instruction.result_id?, instruction)))
        .collect();
    let decorated = |id: u32, wanted: Decoration| {
        module.annotations.iter().find_map(|annotation| match annotation.operands[..] {
            [
                Operand::IdRef(target),
                Operand::Decoration(decoration),
                Operand::LiteralBit32(value),
            ] if target == id && decoration == wanted => Some(value),
            _ => None,
        })
    };
    let variables =
        module.types_global_values.iter().filter(|value| value.class.opcode == Op::Variable);
    variables
        .filter_map(|variable| {
            let id = variable.result_id?;
            let place =
                (decorated(id, Decoration::DescriptorSet)?, decorated(id, Decoration::Binding)?);
            let Operand::StorageClass(class) = variable.operands[0] else { return None };
            let kind = match class {
                StorageClass::Uniform => DescriptorType::UNIFORM_BUFFER,
                StorageClass::StorageBuffer => DescriptorType::STORAGE_BUFFER,
                _ => texture(by_id[&pointee(by_id[&variable.result_type?])]),
            };
            Some((place, kind))
        })
        .collect()
}

fn pointee(pointer: &Instruction) -> u32 {
    match pointer.operands[..] {
        [_, Operand::IdRef(pointee)] => pointee,
        _ => panic!("{pointer:?} is no pointer"),
    }
}

fn texture(class: &Instruction) -> DescriptorType {
    match (class.class.opcode, &class.operands[..]) {
        (Op::TypeSampler, _) => DescriptorType::SAMPLER,
        // Sampled type, dimension, depth, arrayed, multisampled, sampled: 2 is for storage.
        (Op::TypeImage, [_, _, _, _, _, Operand::LiteralBit32(2), ..]) => {
            DescriptorType::STORAGE_IMAGE
        }
        (Op::TypeImage, _) => DescriptorType::SAMPLED_IMAGE,
        _ => panic!("{class:?} is bound, and no texture"),
    }
}
