# SPDX-License-Identifier: Apache-2.0
"""Looking at what there is: inspect, report card, pictures, demo."""
