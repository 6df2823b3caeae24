//! A stable radix sort of (key, value) pairs.

const BITS: u32 = 11;
const BUCKETS: usize = 1 << BITS;

/// Sorts by key, pairs of equal keys staying in order. `scratch` is a workspace.
pub(crate) fn sort_pairs(pairs: &mut Vec<[u32; 2]>, scratch: &mut Vec<[u32; 2]>) {
    let mut counts = [[0u32; BUCKETS]; 3];
    for &[key, _] in pairs.iter() {
        for (pass, counts) in counts.iter_mut().enumerate() {
            counts[digit(key, pass)] += 1;
        }
    }
    scratch.clear();
    scratch.resize(pairs.len(), [0; 2]);
    for (pass, counts) in counts.iter_mut().enumerate() {
        if counts.contains(&(pairs.len() as u32)) {
            continue;
        }
        let mut next = 0;
        for count in counts.iter_mut() {
            (*count, next) = (next, next + *count);
        }
        for &pair in pairs.iter() {
            let place = &mut counts[digit(pair[0], pass)];
            scratch[*place as usize] = pair;
            *place += 1;
        }
        std::mem::swap(pairs, scratch);
    }
}

fn digit(key: u32, pass: usize) -> usize {
    (key >> (BITS * pass as u32)) as usize & (BUCKETS - 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};

    #[test]
    fn sorts_stably() {
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(1);
        for mask in [u32::MAX, 0xff, 0xfff0_0000, 0] {
            for n in [0, 1, 2, 5000] {
                let mut pairs: Vec<[u32; 2]> = (0..n).map(|i| [rng.random::<u32>() & mask, i]).collect();
                let mut want = pairs.clone();
                want.sort();
                sort_pairs(&mut pairs, &mut Vec::new());
                assert_eq!(pairs, want);
            }
        }
    }
}
