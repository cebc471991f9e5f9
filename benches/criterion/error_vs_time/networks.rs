//! Networks: single precision against double, and what a fit of a rippled torus reaches in how much
//! time.

use crate::record::{Record, Run, timed};
use if_core::aabb::Aabb;
use if_core::field::{FieldSample, SignedDistance};
use if_core::math::{Point, Real, Vector, unit_or_zero};
use if_core::monitor::Silent;
use if_neural::Isa;
use if_neural::fit::{Fit, FitParams};
use if_neural::frozen::FrozenMlp;
use if_neural::grid::GridConfig;
use if_neural::mlp::SdfConfig;
use if_neural::network::NetworkConfig;
use if_neural::reference::ReferenceSdf;
use if_neural::sampling::SamplingParams;
use if_neural::sdf::SdfNetwork;
use if_neural::target::Target;
use if_neural::trainable::{Sample32, TrainableField};

pub(crate) fn run(record: &mut Record) {
    precision(record, "fast", &SdfConfig::fast());
    precision(record, "paper", &SdfConfig::paper());
    fits(record);
}

fn precision(record: &mut Record, name: &str, config: &SdfConfig) {
    let problem = format!("2,000 samples, preset {name}");
    let network = SdfNetwork::new(config, 1).unwrap();
    let points: Vec<[f32; 3]> = (0..2000u32)
        .map(|k| {
            [12.9898f32, 78.233, 37.719]
                .map(|f| ((f * (k + 1) as f32).sin() * 43758.547).fract() * 0.9)
        })
        .collect();
    let theta = network.parameters().iter().map(|&v| f64::from(v)).collect();
    let twin = ReferenceSdf::new(config, theta).unwrap();
    let (ms, exact) =
        timed(|| points.iter().map(|p| twin.sample(p.map(f64::from))).collect::<Vec<_>>());
    let mut push = |method: &str, default, ms, error| {
        let run = Run {
            problem: &problem,
            method,
            parameter: "value and gradient".into(),
            unit: "",
            default,
        };
        record.push(run, ms, error, [2000, 0]);
    };
    push("f64, point by point", false, ms, 0.0);
    let chosen = FrozenMlp::new(config, network.parameters()).unwrap().isa().name();
    for isa in Isa::all() {
        let frozen = FrozenMlp::with_isa(config, network.parameters(), isa).unwrap();
        let mut out = vec![Sample32::default(); points.len()];
        let (ms, ()) = timed(|| frozen.samples(&points, &mut out));
        let worst = out
            .iter()
            .zip(&exact)
            .map(|(s, e)| (f64::from(s.value) - e.0).abs())
            .fold(0.0, f64::max);
        // docs/evidence/neural.md: 6.4e-7.
        assert!(worst < 2e-6, "{name}, {}: {worst}", isa.name());
        let method = format!("f32, {}", isa.name());
        push(&method, isa.name() == chosen, ms, worst);
    }
}

/// A torus with ripples of 5 mm, about a metre wide. Its distance is that of the torus less the
/// ripple: |∇φ| is off 1 by 6 %.
struct Rippled;

impl SignedDistance for Rippled {
    fn distance(&self, p: &Point) -> Real {
        let ring = p.x.hypot(p.z) - 0.4;
        ring.hypot(p.y) - 0.12 - 0.005 * (12.0 * p.x).sin() * (12.0 * p.y).cos()
    }
    fn sample(&self, p: &Point) -> FieldSample {
        let around = p.x.hypot(p.z);
        let ring = around - 0.4;
        let out = unit_or_zero(&Vector::new(p.x, 0.0, p.z));
        let tube = unit_or_zero(&(out * ring + Vector::y() * p.y));
        let ripple = 0.06
            * Vector::new(
                (12.0 * p.x).cos() * (12.0 * p.y).cos(),
                -(12.0 * p.x).sin() * (12.0 * p.y).sin(),
                0.0,
            );
        FieldSample { distance: self.distance(p), gradient: tube - ripple }
    }
    fn bounds(&self) -> Option<Aabb> {
        Some(Aabb { min: Point::new(-0.53, -0.13, -0.53), max: Point::new(0.53, 0.13, 0.53) })
    }
    fn lipschitz(&self) -> Real {
        1.06
    }
}

fn fits(record: &mut Record) {
    let grid = |finest, levels, features| {
        NetworkConfig::Grid(GridConfig { finest, levels, features, ..Default::default() })
    };
    let narrow = |width| NetworkConfig::Sdf(SdfConfig { width, ..SdfConfig::fast() });
    let configs = [
        ("grid", "64 cells, 3 levels".to_owned(), grid(64, 3, 1)),
        ("grid", "128 cells, 4 levels".to_owned(), grid(128, 4, 1)),
        ("grid", "192 cells, 5 levels".to_owned(), NetworkConfig::grid()),
        ("grid", "192 cells, 2 features".to_owned(), grid(192, 5, 2)),
        ("MLP", "128 wide".to_owned(), narrow(128)),
        ("MLP", "256 wide (fast)".to_owned(), NetworkConfig::fast()),
        ("MLP", "512 wide (paper)".to_owned(), NetworkConfig::paper()),
    ];
    let seconds: &[Real] = if record.quick { &[2.0] } else { &[2.0, 8.0, 20.0] };
    let sampling = SamplingParams::default();
    for (method, setting, config) in configs {
        for &limit in seconds {
            let target = Target::Field(&Rippled);
            let (set, mut network) = target.begin(&config, &sampling).unwrap();
            let params =
                FitParams { seconds: Some(limit), loss: target.loss(), ..config.fit_params() };
            let report = Fit::new(params).unwrap().run(&mut network, &set, &mut Silent).unwrap();
            // Its first values are the target's, at cells of 6 mm, and the best state is kept.
            let error = report.error.mean;
            assert!(
                config != NetworkConfig::grid() || error < 1e-3,
                "{setting}, {limit} s: {error} m"
            );
            let default = config == NetworkConfig::grid() && limit == 20.0;
            let parameter = format!("{setting}, {limit} s");
            let run = Run {
                problem: "fit of a rippled torus",
                method,
                parameter,
                unit: "m mean",
                default,
            };
            record.push(run, report.seconds * 1e3, error, [report.samples, 0]);
        }
    }
}
