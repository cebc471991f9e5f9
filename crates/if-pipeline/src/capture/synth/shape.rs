//! Errors of an estimator of body shape.

use super::noise::normal;
use if_body::{Joint, Skeleton, TemplateBody};
use if_core::math::{Point, Real, Vector};
use if_core::parameter::ParameterError;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::f64::consts::TAU;

/// Error of the template's shape.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ShapeNoise {
    /// Standard deviation of a bone's share of additional length, from 0 to 0.2.
    pub bones: Real,
    /// Error of the circumference, from 0 to 0.2, in metres.
    pub girth: Real,
}

impl ShapeNoise {
    /// Checks the ranges.
    ///
    /// # Errors
    ///
    /// The first parameter that is out of range or NaN.
    pub fn validate(&self) -> Result<(), ParameterError> {
        let small = |x: Real| (0.0..=0.2).contains(&x);
        ParameterError::check("bones", self.bones, small(self.bones), "from 0 to 0.2")?;
        ParameterError::check("girth", self.girth, small(self.girth), "from 0 to 0.2 (m)")
    }
}

/// The body as an estimator gives it. Each bone is longer by a normally distributed share, left and
/// right alike; the surface follows its joints, stretches along its bones, and moves along its
/// normals, out or in by the seed.
pub(super) fn misshapen(body: TemplateBody, noise: ShapeNoise, seed: u64) -> TemplateBody {
    if noise == ShapeNoise::default() {
        return body;
    }
    let mut rng = Pcg64Mcg::seed_from_u64(seed ^ 0x5_4A9E);
    let joints = body.skeleton.joints();
    let mut shares: BTreeMap<String, Real> = BTreeMap::new();
    let mut share = |joint: &Joint| {
        let name = joint.name.to_lowercase().replace("left", "").replace("right", "");
        *shares.entry(name).or_insert_with(|| noise.bones * normal(&mut rng))
    };
    // By how much heads and tails move.
    let mut heads: Vec<Vector> = Vec::with_capacity(joints.len());
    let mut tails: Vec<Vector> = Vec::with_capacity(joints.len());
    for joint in joints {
        let head = joint.parent.map_or(Vector::zeros(), |p| {
            heads[p] + (joint.head - joints[p].head) * share(&joints[p])
        });
        heads.push(head);
        tails.push(head + (joint.tail - joint.head) * share(joint));
    }
    let sign = if rng.random_bool(0.5) { 1.0 } else { -1.0 };
    let outwards = sign * noise.girth / TAU;

    let (on, weights) = (body.skin.joints(), body.skin.weights());
    let normals = body.mesh.vertex_normals();
    let moved = |(v, p): (usize, &Point)| {
        let by_bone = |(j, w): (&u16, &f32)| {
            let j = usize::from(*j);
            let bone = joints[j].tail - joints[j].head;
            let along = (p - joints[j].head).dot(&bone) / bone.norm_squared().max(1e-12);
            (heads[j] + (tails[j] - heads[j]) * along.clamp(0.0, 1.0)) * Real::from(*w)
        };
        p + on[v].iter().zip(&weights[v]).map(by_bone).sum::<Vector>() + normals[v] * outwards
    };
    let vertices = body.mesh.vertices().iter().enumerate().map(moved).collect();
    let joint = |(joint, (head, tail)): (&Joint, (&Vector, &Vector))| Joint {
        head: joint.head + head,
        tail: joint.tail + tail,
        ..joint.clone()
    };
    let bones = joints.iter().zip(heads.iter().zip(&tails)).map(joint).collect();
    TemplateBody {
        mesh: body.mesh.with_vertices(vertices).expect("finite shifts of finite vertices"),
        skeleton: Skeleton::new(bones).expect("names and parents are those of a skeleton"),
        ..body
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_body::mannequin::{self, MannequinParams, rig};

    #[test]
    fn bones_stretch_alike_on_both_sides_and_girth_moves_the_surface_evenly() {
        let mesh = mannequin::body(&MannequinParams { resolution: 0.7, overlap: 0.0 });
        let skin = rig::skin_weights(mesh.vertices());
        let body = TemplateBody { mesh, skin, skeleton: rig::skeleton() };
        let same = misshapen(body.clone(), ShapeNoise::default(), 1);
        assert_eq!((&same.mesh, &same.skeleton), (&body.mesh, &body.skeleton));

        let girth = ShapeNoise { bones: 0.0, girth: 0.02 };
        let wide = misshapen(body.clone(), girth, 1);
        assert_eq!(wide.skeleton, body.skeleton);
        for (p, q) in wide.mesh.vertices().iter().zip(body.mesh.vertices()) {
            assert!(((p - q).norm() * TAU - 0.02).abs() < 1e-9);
        }

        let long = misshapen(body.clone(), ShapeNoise { bones: 0.03, girth: 0.0 }, 1);
        let length = |body: &TemplateBody, name: &str| {
            let joints = body.skeleton.joints();
            let child = joints.iter().find(|j| j.name == name).unwrap();
            (child.head - joints[child.parent.unwrap()].head).norm()
        };
        let mut squares = 0.0;
        let mut count = 0.0;
        for joint in body.skeleton.joints().iter().filter(|j| j.parent.is_some()) {
            let share = length(&long, &joint.name) / length(&body, &joint.name) - 1.0;
            if let Some(name) = joint.name.strip_prefix("left") {
                let other = format!("right{name}");
                let right = length(&long, &other) / length(&body, &other) - 1.0;
                approx::assert_relative_eq!(share, right, epsilon = 1e-9);
            }
            squares += share * share;
            count += 1.0;
        }
        let deviation = Real::sqrt(squares / count);
        assert!((0.01..0.06).contains(&deviation), "{deviation}");
    }
}
