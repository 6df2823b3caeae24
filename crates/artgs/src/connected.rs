//! Connected components of graphs.

/// Component of each of `n` nodes, numbered by first member, under undirected edges.
pub(crate) fn connected_components(n: usize, edges: impl IntoIterator<Item = (usize, usize)>) -> Vec<u32> {
    fn root(parent: &mut [u32], mut i: u32) -> u32 {
        while parent[i as usize] != i {
            parent[i as usize] = parent[parent[i as usize] as usize];
            i = parent[i as usize];
        }
        i
    }
    let mut parent: Vec<u32> = (0..n as u32).collect();
    for (i, j) in edges {
        let (a, b) = (root(&mut parent, i as u32), root(&mut parent, j as u32));
        parent[a.max(b) as usize] = a.min(b);
    }
    let mut name = vec![u32::MAX; n];
    let mut count = 0;
    (0..n as u32)
        .map(|i| {
            let r = root(&mut parent, i) as usize;
            if name[r] == u32::MAX {
                name[r] = count;
                count += 1;
            }
            name[r]
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn components_are_numbered_by_their_first_member() {
        assert_eq!(connected_components(5, [(4, 1), (3, 0)]), [0, 1, 2, 0, 1]);
        assert_eq!(connected_components(0, []), Vec::<u32>::new());
    }
}
