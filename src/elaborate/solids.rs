//! `solid "FILE" on BODY`: meshes from files as parts of bodies.

use super::codes;
use super::dimension::Dimension;
use super::eval::{Env, Evaluator, Failed, Outcome};
use super::mechanism::Outside;
use super::placing;
use super::sheet::Sheet;
use super::stl::{MOST_BYTES, StlFault};
use super::structure::Structure;
use super::{FileError, SolidFile};
use crate::diagnostic::{Diagnostic, Origin};
use crate::ir::expr::Node;
use crate::ir::{AddedSolid, ExprPoint, TriangleMesh};
use crate::syntax::ast;
use nalgebra::Matrix3;
use std::sync::Arc;

impl<'a> Evaluator<'a> {
    /// All solids, each in its body.
    pub(super) fn solids(
        &mut self,
        scope: usize,
        sheet: &Sheet<'a>,
        s: &mut Structure<'a>,
        outside: &Outside<'_>,
    ) {
        let first = sheet.solids.first().map(|h| h.1).unwrap_or_default();
        if self.limit(sheet.solids.len(), "solids", first).is_err() {
            return;
        }
        for (text, at) in &sheet.solids {
            let Ok((body, solid)) = self.solid(scope, text, *at, s, outside) else { continue };
            s.bodies.get_mut(body).into_iter().for_each(|b| b.fittings.solids.push(solid.clone()));
        }
    }

    pub(super) fn solid(
        &mut self,
        scope: usize,
        text: &'a ast::Solid,
        at: Origin,
        s: &Structure<'a>,
        outside: &Outside<'_>,
    ) -> Outcome<(usize, AddedSolid)> {
        let body = self.thing(scope, &s.body_index, &text.body, "body");
        let position = self.solid_place(scope, text);
        let rotation = self.solid_turn(scope, text);
        let scale = self.solid_scale(scope, text);
        let mesh = self.solid_mesh(text, outside);
        let (body, position, rotation, scale, mesh) = (body?, position?, rotation?, scale?, mesh?);
        let (file, digest) = (text.file.node.clone(), mesh.digest.clone());
        Ok((body, AddedSolid { file, digest, mesh, position, rotation, scale, origin: at }))
    }

    /// Where the file's origin goes: the drawing's origin where nothing is said.
    fn solid_place(&mut self, scope: usize, text: &'a ast::Solid) -> Outcome<ExprPoint> {
        match &text.point {
            Some(e) => self.eval(&Env::fixed(scope), e).and_then(|v| self.as_point(v, e)),
            None => {
                let zero = self.exprs.push(Node::Const(0.0));
                Ok([zero; 3])
            }
        }
    }

    /// All turns, one after the other, about directions of the drawing.
    fn solid_turn(&mut self, scope: usize, text: &'a ast::Solid) -> Outcome<[[f64; 3]; 3]> {
        let mut turn = Matrix3::identity();
        let mut ok = Ok(());
        for (angle, axis) in &text.turned {
            let angle = self.eval_fixed(scope, angle, Dimension::ANGLE, "the angle");
            let axis = self.direction(scope, axis);
            match angle.and_then(|a| Ok((a, axis?))) {
                Ok((angle, axis)) => turn = placing::placement([0.0; 3], angle, axis).matrix() * turn,
                Err(Failed) => ok = Err(Failed),
            }
        }
        ok?;
        Ok([0, 1, 2].map(|i| [0, 1, 2].map(|j| turn[(i, j)])))
    }

    /// A solid grows with the drawing that it belongs to.
    fn solid_scale(&mut self, scope: usize, text: &'a ast::Solid) -> Outcome<f64> {
        let Some(e) = &text.scale else { return Ok(self.scale) };
        let k = self.eval_fixed(scope, e, Dimension::NUMBER, "the scale")?;
        if k > 0.0 {
            return Ok(k * self.scale);
        }
        self.fail(
            Diagnostic::error(codes::SIZE, "the scale must be positive", e.at)
                .help("`scale = 25.4` takes the file's lengths for inches"),
        )
    }

    fn solid_mesh(&mut self, text: &ast::Solid, outside: &Outside<'_>) -> Outcome<Arc<TriangleMesh>> {
        let (path, at) = (&text.file.node, text.file.at);
        if let Some(why) = super::load::leads_out(path) {
            return self.fail(
                Diagnostic::error(codes::IMPORT_REFUSED, format!("`{path}` may not be read"), at)
                    .label(why)
                    .help("a source reads only files below its own folder"),
            );
        }
        let file: Arc<SolidFile> = match outside.files.solid(path) {
            Ok(file) => file,
            Err(why) => {
                let label = match why {
                    FileError::TooLarge => format!("it is larger than {} MiB", MOST_BYTES >> 20),
                    why => why.to_string(),
                };
                return self.fail(
                    Diagnostic::error(codes::IMPORT_UNREADABLE, format!("cannot read `{path}`"), at)
                        .label(label)
                        .help("the path starts from the folder of the design"),
                );
            }
        };
        match file.mesh() {
            Ok(mesh) => {
                if mesh.inside_out {
                    let message = format!("`{path}` is inside out");
                    self.out.push(
                        Diagnostic::warning(codes::INSIDE_OUT, message, at)
                            .label("all its triangles are taken the other way round")
                            .help("let the program that made it turn its normals outwards"),
                    );
                }
                Ok(mesh)
            }
            Err(why) => {
                let help = match why {
                    StlFault::TooMany(_) => {
                        "let a mesh program simplify it: what is finer than the printer is lost anyway"
                    }
                    StlFault::NoPlace(_) => {
                        "a solid's lengths are millimetres: export it anew, or scale it before"
                    }
                    _ => "export the body as STL, binary or ASCII, from the program that it was made with",
                };
                self.fail(
                    Diagnostic::error(codes::SOLID_FILE, format!("`{path}` cannot become a solid"), at)
                        .label(why.to_string())
                        .help(help),
                )
            }
        }
    }
}
