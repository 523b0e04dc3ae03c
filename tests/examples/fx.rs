use antumbra::*;
fn main() {
    let tol: f64 = std::env::args().nth(1).unwrap().parse().unwrap();
    for f in std::env::args().skip(2) {
        let text = std::fs::read_to_string(&f).unwrap();
        let v: serde_json::Value = serde_json::from_str(&text).unwrap();
        let input = io::scene_file::read(
            &(if v["scene"].is_object() {
                v["scene"].to_string()
            } else {
                text.clone()
            }),
        )
        .unwrap();
        let scene = Scene::build(&input).unwrap().scene;
        let t = std::time::Instant::now();
        let ev = Evaluator::new(&scene);
        let r = solver::form_factors(
            &ev,
            &solver::FactorOptions {
                tolerance: tol,
                ..Default::default()
            },
            &|| false,
            &|_| {},
        );
        let el = t.elapsed().as_secs_f64();
        if !v["F"].is_array() {
            println!("{f} surfaces {} evals {} {el:.3}s", r.n(), r.evaluations);
            let clos = (0..r.n())
                .map(|i| (1.0 - (0..r.n()).map(|j| r.values[i * r.n() + j]).sum::<f64>()).abs())
                .fold(0.0, f64::max);
            let most = (0..r.n())
                .map(|i| (0..r.n()).map(|j| r.values[i * r.n() + j]).sum::<f64>())
                .fold(0.0, f64::max);
            println!("   closure {clos:.2e} largest row {most}");
            continue;
        }
        let names: Vec<&str> = v["names"]
            .as_array()
            .unwrap()
            .iter()
            .map(|x| x.as_str().unwrap())
            .collect();
        let idx: Vec<usize> = names
            .iter()
            .map(|n| scene.surface_named(n).unwrap().index())
            .collect();
        let mut worst = 0.0f64;
        let mut cnt = 0;
        let mut maxb = 0.0f64;
        let mut who = (0, 0);
        for i in 0..names.len() {
            for j in 0..names.len() {
                if let Some(w) = v["F"][i][j].as_f64() {
                    if let Some(p) = v["pairs"].as_array() {
                        if !p.iter().any(|q| {
                            q[0].as_u64() == Some(i as u64) && q[1].as_u64() == Some(j as u64)
                        }) {
                            continue;
                        }
                    }
                    cnt += 1;
                    let k = idx[i] * r.n() + idx[j];
                    let e = (r.values[k] - w).abs();
                    if e > worst {
                        worst = e;
                        who = (i, j);
                    }
                    maxb = maxb.max(r.errors[k]);
                }
            }
        }
        let clos = (0..r.n())
            .map(|i| (1.0 - (0..r.n()).map(|j| r.values[i * r.n() + j]).sum::<f64>()).abs())
            .fold(0.0, f64::max);
        println!(
            "{:12} n={cnt:5} worst {worst:.2e} at {}→{} bound {maxb:.2e} closure {clos:.2e} recip {:.1e} of {}/{} evals {} {el:.3}s",
            v["id"].as_str().unwrap(),
            names[who.0],
            names[who.1],
            r.reciprocity.worst,
            r.reciprocity.pairs_checked,
            r.reciprocity.pairs,
            r.evaluations
        );
    }
}
