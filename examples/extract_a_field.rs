//! The surface of a signed distance field of your own, as a mesh.
//!
//! ```text
//! cargo run --release --example extract_a_field
//! ```

#![allow(clippy::print_stdout)] // a program for the terminal

use if_garments::Silent;
use if_garments::core::{Aabb, FieldSample, Point, Real, SignedDistance, Vector};
use if_garments::mesh::{ExtractParams, Resolution, extract};

/// A ball with ripples of 5 mm. Not an exact distance: its gradient is longer than 1 in places.
struct Rippled;

impl SignedDistance for Rippled {
    fn distance(&self, p: &Point) -> Real {
        self.sample(p).distance
    }

    fn sample(&self, p: &Point) -> FieldSample {
        let (r, k) = (p.coords.norm().max(1e-9), 40.0);
        let ripple = Vector::new((k * p.x).cos(), 0.0, 0.0) * (0.005 * k);
        let distance = r - 0.2 + 0.005 * (k * p.x).sin();
        FieldSample { distance, gradient: p.coords / r + ripple }
    }

    fn lipschitz(&self) -> Real {
        1.2 // 1 of the ball and 0.005 · 40 of the ripples
    }

    fn bounds(&self) -> Option<Aabb> {
        Some(Aabb { min: Point::new(-0.21, -0.21, -0.21), max: Point::new(0.21, 0.21, 0.21) })
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let params =
        ExtractParams { resolution: Resolution::Cell(0.005), relax: 3, ..Default::default() };
    let found = extract(&Rippled, &params, &mut Silent)?;
    let off = found.mesh.vertices().iter().map(|p| Rippled.sample(p).distance.abs());
    let worst = off.fold(0.0, Real::max);
    println!("{} triangles, vertices {worst:.1e} off", found.mesh.triangles().len());
    assert!(worst < 1e-4 && found.report.warnings.is_empty());
    assert!(found.mesh.signed_volume() > 0.03);
    Ok(())
}
