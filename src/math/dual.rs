//! Forward automatic differentiation: first-order dual numbers with a fixed number of directions, and
//! the few scalar operations that code generic over "a number or a dual number" needs.

use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub};

/// A real number, possibly carrying derivatives.
pub trait Real:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + AddAssign
{
    /// A constant.
    fn constant(value: f64) -> Self;
    /// The value without derivatives.
    fn value(&self) -> f64;
    /// Square root.
    fn sqrt(self) -> Self;
    /// Exponential.
    fn exp(self) -> Self;
    /// Angle of the point (`x`, `self`), rad.
    fn atan2(self, x: Self) -> Self;
    /// Product with a constant.
    fn scale(self, factor: f64) -> Self;
}

impl Real for f64 {
    fn constant(value: f64) -> Self {
        value
    }
    fn value(&self) -> f64 {
        *self
    }
    fn sqrt(self) -> Self {
        f64::sqrt(self)
    }
    fn exp(self) -> Self {
        f64::exp(self)
    }
    fn atan2(self, x: Self) -> Self {
        f64::atan2(self, x)
    }
    fn scale(self, factor: f64) -> Self {
        self * factor
    }
}

/// A value with its derivatives in `N` directions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dual<const N: usize> {
    /// Value.
    pub re: f64,
    /// Derivatives.
    pub eps: [f64; N],
}

impl<const N: usize> Dual<N> {
    /// Variable number `index` (a constant if `index >= N`).
    pub fn variable(value: f64, index: usize) -> Self {
        let mut eps = [0.0; N];
        if let Some(e) = eps.get_mut(index) {
            *e = 1.0;
        }
        Self { re: value, eps }
    }

    /// `f(self)` given `f` and its derivative there.
    #[inline]
    fn chain(self, re: f64, slope: f64) -> Self {
        Self { re, eps: self.eps.map(|e| e * slope) }
    }

    /// Derivatives `s a' + t b'`.
    #[inline]
    fn combine(a: &[f64; N], s: f64, b: &[f64; N], t: f64) -> [f64; N] {
        std::array::from_fn(|i| a[i] * s + b[i] * t)
    }
}

impl<const N: usize> Add for Dual<N> {
    type Output = Self;
    #[inline]
    fn add(self, o: Self) -> Self {
        Self { re: self.re + o.re, eps: std::array::from_fn(|i| self.eps[i] + o.eps[i]) }
    }
}

impl<const N: usize> AddAssign for Dual<N> {
    #[inline]
    fn add_assign(&mut self, o: Self) {
        *self = *self + o;
    }
}

impl<const N: usize> Sub for Dual<N> {
    type Output = Self;
    #[inline]
    fn sub(self, o: Self) -> Self {
        Self { re: self.re - o.re, eps: std::array::from_fn(|i| self.eps[i] - o.eps[i]) }
    }
}

impl<const N: usize> Mul for Dual<N> {
    type Output = Self;
    #[inline]
    fn mul(self, o: Self) -> Self {
        Self { re: self.re * o.re, eps: Self::combine(&self.eps, o.re, &o.eps, self.re) }
    }
}

impl<const N: usize> Div for Dual<N> {
    type Output = Self;
    #[inline]
    fn div(self, o: Self) -> Self {
        let re = self.re / o.re;
        Self { re, eps: Self::combine(&self.eps, 1.0 / o.re, &o.eps, -re / o.re) }
    }
}

impl<const N: usize> Neg for Dual<N> {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        self.chain(-self.re, -1.0)
    }
}

impl<const N: usize> Real for Dual<N> {
    fn constant(value: f64) -> Self {
        Self { re: value, eps: [0.0; N] }
    }
    fn value(&self) -> f64 {
        self.re
    }
    fn sqrt(self) -> Self {
        let root = self.re.sqrt();
        self.chain(root, 0.5 / root)
    }
    fn exp(self) -> Self {
        let value = self.re.exp();
        self.chain(value, value)
    }
    fn atan2(self, x: Self) -> Self {
        let r2 = self.re * self.re + x.re * x.re;
        Self { re: self.re.atan2(x.re), eps: Self::combine(&self.eps, x.re / r2, &x.eps, -self.re / r2) }
    }
    fn scale(self, factor: f64) -> Self {
        self.chain(self.re * factor, factor)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample<T: Real>(x: T, y: T) -> T {
        let r = (x * x + y.scale(3.0) * y).sqrt();
        (x - y).atan2(r) / (x + T::constant(2.0)) + -y * (x * y).exp()
    }

    #[test]
    fn derivatives_match_differences() {
        let (x, y) = (0.7, -1.3);
        let d = sample(Dual::<2>::variable(x, 0), Dual::<2>::variable(y, 1));
        let h = 1e-6;
        let dx = (sample(x + h, y) - sample(x - h, y)) / (2.0 * h);
        let dy = (sample(x, y + h) - sample(x, y - h)) / (2.0 * h);
        assert!((d.re - sample(x, y)).abs() < 1e-15);
        assert!((d.eps[0] - dx).abs() < 1e-9 && (d.eps[1] - dy).abs() < 1e-9);
    }
}
