//! Connected pieces of parts.

/// Two surfels that are neighbours, and how much a border between them costs.
pub(super) type Edge = (u32, u32, f32);

/// For every surfel, the number of the piece it belongs to: surfels of one label that edges connect. Numbers begin at 0 and leave none out.
pub(super) fn components(labels: &[u16], edges: &[Edge]) -> Vec<u32> {
    let mut roots: Vec<u32> = (0..labels.len() as u32).collect();
    let root = |roots: &mut Vec<u32>, mut i: u32| {
        while roots[i as usize] != i {
            roots[i as usize] = roots[roots[i as usize] as usize];
            i = roots[i as usize];
        }
        i
    };
    for &(i, j, _) in edges.iter().filter(|(i, j, _)| labels[*i as usize] == labels[*j as usize]) {
        let (a, b) = (root(&mut roots, i), root(&mut roots, j));
        roots[a.max(b) as usize] = a.min(b);
    }
    // Roots are the smallest of their pieces, and come first.
    let (mut numbers, mut count) = (vec![0; labels.len()], 0);
    for i in 0..labels.len() as u32 {
        let first = root(&mut roots, i);
        if first == i {
            numbers[i as usize] = count;
            count += 1;
        } else {
            numbers[i as usize] = numbers[first as usize];
        }
    }
    numbers
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edges_connect_only_surfels_of_one_part() {
        let edges = [(0, 1, 1.0), (1, 2, 1.0), (2, 3, 1.0), (4, 5, 0.0), (3, 6, 1.0), (0, 6, 1.0)];
        assert_eq!(components(&[1, 1, 2, 2, 1, 1, 2, 0], &edges), [0, 0, 1, 1, 2, 2, 1, 3]);
        assert_eq!(components(&[], &[]), Vec::<u32>::new());
    }
}
