//! A body that is kept: garments that lie clean over one that yields are pushed out of it again,
//! everywhere but in its pinches.
//!
//! ```text
//! pinch: body triangles that meet the body, or a corner of which has less room than the layers need;
//!        a ring more if a step does not end clean, up to three
//! the body goes from where it yielded to where it is kept; garments give way, but for pinches
//! ```
//!
//! In a pinch the body yields from both sides, so that the cloth there lies on the middle surface, and
//! there it stays: it moves with the body and does not flutter between the sheets of skin
//! [Baraff et al. 2003]. The rest is pushed out by millimetres, where the body yielded beside the
//! pinch.

use super::facing::{pinched, room};
use super::locality::Yielding;
use super::params::WalkParams;
use super::proof::{Proof, prove};
use super::walk::{WalkError, Walked, Walker};
use crate::findings::own_with;
use if_core::math::{Point, Real};
use if_core::monitor::Monitor;

/// Times that a step towards the body that is kept is halved before the pinch widens.
const HALVINGS: u32 = 1;
/// Times that the pinches of a body widen by a ring of triangles, if garments do not come out beside
/// them: 4 cm of a body with edges of 13 mm.
const RINGS: usize = 3;
/// Most steps from the body that yields to the one that is kept.
const MOST_STEPS: Real = 100.0;

impl Walker {
    /// Garments that lie free of intersections in `from`, over a body that yields, over the body as
    /// it is at `reference`; and what is verified there.
    ///
    /// Body and garments may intersect in pinches: triangles of the body that meet it, or a corner of
    /// which faces the body within (2 n + 1) gaps for n garments; and up to three rings of triangles
    /// around those, where garments do not come out otherwise. [`Proof::pinched`] has those pairs,
    /// and no other field. Own pairs of the body are those of `reference`.
    ///
    /// # Errors
    ///
    /// An invalid state, or the monitor cancelled.
    pub fn keep(
        &mut self,
        from: &[Point],
        reference: &[Point],
        monitor: &mut dyn Monitor,
    ) -> Result<(Vec<Point>, Proof), WalkError> {
        self.check(reference)?;
        self.restart(from.to_vec())?;
        let body = self.scene.starts[1];
        let mut to = from.to_vec();
        to[..body].copy_from_slice(&self.storage.round(&reference[..body]));
        self.scene.copy_doubled(&mut to);
        let room = room(self.scene.layers() - 1, self.params.gap);
        self.tolerated.pinched = Some(pinched(&self.scene.layer_mesh(&to, 0), room));
        let kept = self.kept(from, &to, monitor);
        let tolerated = std::mem::take(&mut self.tolerated.pinched);
        let mut x = kept?;
        x[..body].copy_from_slice(&to[..body]);
        self.tolerated.pinched = tolerated;
        let proof = prove(&self.scene, &x, &self.tolerated);
        self.tolerated.pinched = None;
        // What was tolerated in pinches is so no more.
        self.clean.is_verified = false;
        Ok((x, proof))
    }

    /// As far as the garments come while the body goes from `from` to `to`. Where they do not come
    /// out, the pinch is wider than the normals of the skin show.
    fn kept(
        &mut self,
        from: &[Point],
        to: &[Point],
        monitor: &mut dyn Monitor,
    ) -> Result<Vec<Point>, WalkError> {
        let mesh = self.mesh(from)?;
        if !self.tolerated.left(&own_with(&mesh, &self.tree(from), &self.scene.fans)).is_empty() {
            return Ok(from.to_vec());
        }
        let mut yielding = Yielding::everywhere(&self.scene);
        yielding.inverse_mass[..self.scene.starts[1]].fill(0.0);
        let params = self.params;
        let watched = params.watched();
        self.params = WalkParams { halvings: HALVINGS, ..params.approaching() };
        let mut walked = Ok(Walked::default());
        for _ in 0..=RINGS {
            let begin = self.target.clone();
            let moves = begin.iter().zip(to).map(|(a, b)| (b - a).norm_squared());
            let largest = moves.fold(0.0, Real::max).sqrt();
            let steps = (2.0 * largest / watched).ceil().min(MOST_STEPS) as usize;
            let path = |t: Real| begin.iter().zip(to).map(|(a, b)| a + (b - a) * t).collect();
            walked = self.follow(steps, &path, Some(yielding.clone()), monitor);
            match &walked {
                Ok(walked) if walked.reached < 1.0 => self.widen_pinches(&walked.unresolved),
                _ => break,
            }
        }
        self.params = params;
        walked.map(|_| self.positions().to_vec())
    }

    /// Adds to pinches the triangles of the body beside them that are among those that are left, or
    /// have a corner in common with one of these; all beside them if no triangle of the body is left.
    fn widen_pinches(&mut self, left: &[[(usize, u32); 2]]) {
        let Some(pinched) = &mut self.tolerated.pinched else { return };
        let triangles = &self.scene.mesh.triangles()[..pinched.len()];
        let corners = |of: &dyn Fn(usize) -> bool| {
            let mut is_corner = vec![false; self.scene.starts[1]];
            for (_, t) in triangles.iter().enumerate().filter(|(k, _)| of(*k)) {
                t.iter().for_each(|v| is_corner[*v as usize] = true);
            }
            is_corner
        };
        let mut is_left = vec![false; triangles.len()];
        for (_, t) in left.iter().flatten().filter(|(layer, _)| *layer == 0) {
            is_left[*t as usize] = true;
        }
        let beside = corners(&|t| pinched[t]);
        let near = corners(&|t| is_left[t]);
        let all = !is_left.contains(&true);
        for (t, pinched) in triangles.iter().zip(pinched) {
            let has = |is_corner: &[bool]| t.iter().any(|v| is_corner[*v as usize]);
            *pinched |= has(&beside) && (all || has(&near));
        }
    }
}
