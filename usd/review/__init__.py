# SPDX-License-Identifier: Apache-2.0
"""Looking at files and bakes: inspect, report card, pictures, demo."""
