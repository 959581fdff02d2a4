//! Printed parts of Chebyshev's linkage, measured on the finished meshes.

#[path = "support/chebyshev.rs"]
mod chebyshev;

use flexura::geometry::{Facets, build_parts, check_mesh};

#[test]
fn parts_are_sound() {
    for bulge in [0.0, 25.0] {
        let input = chebyshev::chebyshev(bulge, Facets::default());
        let start = std::time::Instant::now();
        let parts = build_parts(&input).unwrap();
        let t_build = start.elapsed();
        if let Ok(dir) = std::env::var("FLEXURA_STL_DIR") {
            for part in &parts.parts {
                let bytes = flexura::emit::stl::stl_bytes(&part.mesh).unwrap();
                std::fs::write(format!("{dir}/{}_{bulge}.stl", part.name), bytes).unwrap();
            }
        }
        for f in &parts.fusions {
            println!("{f:?}");
        }
        for part in &parts.parts {
            let start = std::time::Instant::now();
            let facts = check_mesh(&part.mesh);
            println!(
                "{} {:?} {:#?} build {t_build:?} check {:?} {:?}",
                part.name,
                part.bodies,
                facts,
                start.elapsed(),
                part.notes
            );
        }
    }
}
