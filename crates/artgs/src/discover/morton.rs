//! Order of cubes in which neighbours in the list are neighbours in space: what views show of them is then in the cache.

use glam::IVec3;

/// Position of a cube on the Morton curve; each coordinate must be 0 to 2^21 - 1.
pub(super) fn morton(cube: IVec3) -> u64 {
    let spread = |v: i32| {
        let mut v = v as u64 & 0x1f_ffff;
        v = (v | v << 32) & 0x001f_0000_0000_ffff;
        v = (v | v << 16) & 0x001f_0000_ff00_00ff;
        v = (v | v << 8) & 0x100f_00f0_0f00_f00f;
        v = (v | v << 4) & 0x10c3_0c30_c30c_30c3;
        (v | v << 2) & 0x1249_2492_4924_9249
    };
    spread(cube.x) | spread(cube.y) << 1 | spread(cube.z) << 2
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_are_interleaved() {
        for cube in [IVec3::new(5, 0, 0), IVec3::new(1, 2, 4), IVec3::new(0x1f_ffff, 77, 123_456)] {
            let expected = (0..21).fold(0_u64, |code, bit| {
                (0..3).fold(code, |code, axis| code | ((cube[axis] as u64 >> bit) & 1) << (3 * bit + axis as u64))
            });
            assert_eq!(morton(cube), expected);
        }
    }
}
