"""study_maths against numbers worked out by hand."""
import math
import unittest

import study_maths as maths


class Growth(unittest.TestCase):
    def test_power(self):
        exponent, factor = maths.growth([1, 10, 100], [3, 3 * 10**1.5, 3000])
        self.assertAlmostEqual(exponent, 1.5)
        self.assertAlmostEqual(factor, 3)

    def test_least_squares(self):
        # logs to base 10: x 0, 1, 2; y 0, 1, 3. Slope (-1 * -4/3 + 1 * 5/3) / 2 = 1.5, at x = 0: 4/3 - 1.5 = -1/6.
        exponent, factor = maths.growth([1, 10, 100], [1, 10, 1000])
        self.assertAlmostEqual(exponent, 1.5)
        self.assertAlmostEqual(factor, 10 ** (-1 / 6))

    def test_one_size(self):
        with self.assertRaises(ValueError):
            maths.growth([5, 5], [1, 2])

    def test_off_linear(self):
        self.assertAlmostEqual(maths.off_linear([1, 10, 100], [1, 10, 105]), 0.05)
        self.assertAlmostEqual(maths.off_linear([1, 2], [1, 4]), 1 / 3)  # 1 and 2 a unit, middle 1.5


class Profile(unittest.TestCase):
    # Four problems: a is best on the first two, b on the third, none solves the fourth.
    TIMES = {"a": [1.0, 2.0, 6.0, math.inf], "b": [2.0, math.inf, 3.0, math.inf]}

    def test_ratios(self):
        self.assertEqual(maths.ratios(self.TIMES), {"a": [1, 1, 2, math.inf], "b": [2, math.inf, 1, math.inf]})

    def test_profile(self):
        ratios = maths.ratios(self.TIMES)
        self.assertEqual(maths.profile(ratios["a"]), [(1, 0.5), (2, 0.75)])
        self.assertEqual(maths.profile(ratios["b"]), [(1, 0.25), (2, 0.5)])
        self.assertEqual(maths.profile([math.inf]), [])

    def test_unequal_numbers(self):
        with self.assertRaises(ValueError):
            maths.ratios({"a": [1.0], "b": []})

    def test_time_to(self):
        attempts = [(1.0, 1e-2), (3.0, 1e-7), (2.0, 1e-4), (9.0, math.nan)]
        self.assertEqual(maths.time_to(1e-2, attempts), 1.0)
        self.assertEqual(maths.time_to(1e-3, attempts), 2.0)
        self.assertEqual(maths.time_to(1e-6, attempts), 3.0)
        self.assertEqual(maths.time_to(1e-9, attempts), math.inf)


if __name__ == "__main__":
    unittest.main()
