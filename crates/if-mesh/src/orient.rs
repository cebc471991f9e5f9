//! Neighbours wind alike.

use if_core::edges::{Edges, NONE};

/// Turns triangles so that neighbours wind alike, the fewer ones of each patch, where a patch is
/// connected by edges of two triangles. Returns how many were turned. One-sided patches keep edges
/// along which neighbours wind against each other.
pub(crate) fn orient(triangles: &mut [[u32; 3]], edges: &Edges) -> usize {
    let forward = |t: usize, k: usize| triangles[t][k] < triangles[t][(k + 1) % 3];
    let direction = |t: u32, e: usize| {
        let k = edges.of_triangle[t as usize].iter().position(|other| *other as usize == e);
        k.is_some_and(|k| forward(t as usize, k))
    };
    let agree: Vec<bool> = (0..edges.len())
        .map(|e| {
            let [a, b] = edges.triangles[e];
            edges.valence[e] != 2 || b == NONE || direction(a, e) != direction(b, e)
        })
        .collect();
    if agree.iter().all(|a| *a) {
        return 0;
    }
    let mut turn: Vec<Option<bool>> = vec![None; triangles.len()];
    for start in 0..triangles.len() {
        if turn[start].is_some() {
            continue;
        }
        turn[start] = Some(false);
        let mut patch = vec![start as u32];
        let mut next = 0;
        while let Some(&t) = patch.get(next) {
            next += 1;
            let here = turn[t as usize].unwrap_or(false);
            for e in edges.of_triangle[t as usize].map(|e| e as usize) {
                let [a, b] = edges.triangles[e];
                let other = if a == t { b } else { a };
                if edges.valence[e] == 2 && other != NONE && turn[other as usize].is_none() {
                    turn[other as usize] = Some(here == agree[e]);
                    patch.push(other);
                }
            }
        }
        let turned = patch.iter().filter(|t| turn[**t as usize] == Some(true)).count();
        if 2 * turned > patch.len() {
            patch.iter().for_each(|t| turn[*t as usize] = turn[*t as usize].map(|turn| !turn));
        }
    }
    let mut turned = 0;
    for (corners, turn) in triangles.iter_mut().zip(turn) {
        if turn == Some(true) {
            corners.swap(1, 2);
            turned += 1;
        }
    }
    turned
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::mesh::TriMesh;
    use if_core::shapes::meshes::icosphere;

    #[test]
    fn single_turned_triangles_are_turned_back() {
        let ball = icosphere(1.0, 2);
        let mut triangles = ball.triangles().to_vec();
        for t in [0, 7, 8, 100] {
            triangles[t].swap(1, 2);
        }
        let mixed = TriMesh::new(ball.vertices().to_vec(), triangles.clone()).unwrap();
        assert_eq!(orient(&mut triangles, &Edges::new(&mixed)), 4);
        let volume = TriMesh::new(ball.vertices().to_vec(), triangles).unwrap().signed_volume();
        assert_eq!(volume, ball.signed_volume());
    }

    #[test]
    fn a_moebius_strip_ends() {
        let n = 12u32;
        let at = |k: u32| [2 * k, 2 * k + 1];
        let mut triangles = Vec::new();
        for k in 0..n {
            let ([a, b], [mut c, mut d]) = (at(k), at((k + 1) % n));
            if k + 1 == n {
                (c, d) = (d, c);
            }
            triangles.extend([[a, b, c], [b, d, c]]);
        }
        let vertices = (0..2 * n).map(|v| [Into::<f64>::into(v), 0.0, f64::from(v * v)].into());
        let strip = TriMesh::new(vertices.collect(), triangles.clone()).unwrap();
        assert!(orient(&mut triangles, &Edges::new(&strip)) <= triangles.len() / 2);
    }
}
